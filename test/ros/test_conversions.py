"""Messages carry the numbers that went in, in whichever form they come."""

from __future__ import annotations

import math

import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from shake_ros.quantities import ShakeError
from shake_ros.ros.conversions import SECOND, codec, time_message
from shake_ros.ros.interface import (
    CLOCK,
    ESTIMATE,
    IMU,
    JOINT_STATES,
    PRESSURE_A,
    PRESSURE_SUPPLY,
    REFERENCE,
    TOPICS,
    VALVE_COMMAND,
)

SAMPLED = [topic for topic in TOPICS.values() if topic.sampled or topic is CLOCK]
STAMP = 1_234_567_890_123_456_789
NUMBERS = (0.1, -2.5e-300, 1.7976931348623157e308)


@pytest.mark.parametrize("topic", SAMPLED, ids=lambda topic: topic.name)
def test_packed_bytes_are_the_message(topic) -> None:
    packer = codec(topic)
    values = NUMBERS[: packer.size]
    message = deserialize_message(packer.pack(STAMP, values), topic.type)
    assert message == packer.build(STAMP, values)
    assert packer.packed, "the middleware reads another form; the slow path is in use"


@pytest.mark.parametrize("topic", SAMPLED, ids=lambda topic: topic.name)
def test_message_of_the_middleware_is_unpacked(topic) -> None:
    packer = codec(topic)
    values = NUMBERS[: packer.size]
    data = serialize_message(packer.build(STAMP, values))
    assert packer.decode(data) == (STAMP, values)


@pytest.mark.parametrize("topic", SAMPLED, ids=lambda topic: topic.name)
def test_slow_path_gives_the_same_numbers(topic) -> None:
    packer = codec(topic)
    values = NUMBERS[: packer.size]
    packer.packed = False
    assert packer.decode(serialize_message(packer.encode(STAMP, values))) == (STAMP, values)


def test_command_of_another_layout_is_read_by_its_joint_name() -> None:
    message = JointState(name=["other", "servo_valve"], position=[9.0, 0.25], velocity=[1.0, 2.0])
    message.header.frame_id = "valve"
    message.header.stamp = time_message(5 * SECOND)
    assert codec(VALVE_COMMAND).decode(serialize_message(message)) == (5 * SECOND, (0.25,))


def test_nan_and_infinity_pass_the_conversion_unchanged() -> None:
    packer = codec(VALVE_COMMAND)
    assert math.isnan(packer.decode(packer.pack(STAMP, (math.nan,)))[1][0])
    assert packer.decode(packer.pack(STAMP, (-math.inf,)))[1][0] == -math.inf


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (JointState(name=["servo_valve"], position=[0.1]), "joint 'table' is not among"),
        (JointState(name=["table"]), "has no value"),
        (JointState(), "joint 'table' is not among"),
    ],
)
def test_position_of_a_foreign_joint_is_refused_by_name(message, reason) -> None:
    with pytest.raises(ShakeError, match=f"joint_states: .*{reason}"):
        codec(JOINT_STATES).decode(serialize_message(message))


def test_trajectory_without_a_point_is_refused() -> None:
    with pytest.raises(ShakeError, match="reference: 0 points"):
        codec(REFERENCE).decode(serialize_message(REFERENCE.type(joint_names=["table"])))


def test_a_topic_that_is_not_sampled_has_no_codec() -> None:
    with pytest.raises(ShakeError, match="thd is not a sampled topic"):
        codec(TOPICS["thd"])


@pytest.mark.parametrize("topic", SAMPLED, ids=lambda topic: topic.name)
def test_every_header_names_its_frame(topic) -> None:
    message = deserialize_message(codec(topic).pack(STAMP, NUMBERS[: codec(topic).size]), topic.type)
    if topic is not CLOCK:
        assert message.header.frame_id == ("table" if topic.type is IMU.type else "ground")


@pytest.mark.parametrize("topic", [IMU, PRESSURE_A, PRESSURE_SUPPLY], ids=lambda topic: topic.name)
def test_variance_of_the_noise_is_told_and_does_not_keep_a_reader_from_the_numbers(topic) -> None:
    writer, reader = codec(topic), codec(topic)
    writer.variance = 0.0025
    data = writer.pack(STAMP, (1.5,))
    message = deserialize_message(data, topic.type)
    told = message.linear_acceleration_covariance[0] if topic is IMU else message.variance
    assert told == 0.0025
    assert message == writer.build(STAMP, (1.5,))
    assert reader._unpack(data) == (STAMP, (1.5,))


def test_recording_of_earlier_days_without_frames_is_read_as_well() -> None:
    message = codec(IMU).build(STAMP, (2.5,))
    message.header.frame_id = ""
    assert codec(IMU).decode(serialize_message(message)) == (STAMP, (2.5,))


def test_lead_of_an_estimate_is_its_time_from_start_and_is_read_by_either_path() -> None:
    writer, reader = codec(ESTIMATE), codec(ESTIMATE)
    writer.lead = 2_003_400_000
    data = writer.pack(STAMP, NUMBERS)
    message = deserialize_message(data, ESTIMATE.type)
    assert (message.points[0].time_from_start.sec, message.points[0].time_from_start.nanosec) == (2, 3_400_000)
    assert message == writer.build(STAMP, NUMBERS)
    assert reader._unpack(data) == (STAMP, NUMBERS) and reader.lead == 2_003_400_000
    reader.lead, reader.packed = 0, False
    assert reader.decode(data) == (STAMP, NUMBERS) and reader.lead == 2_003_400_000
