"""The recorder over DDS: nothing lost, every end is a proper end, and a kill costs less than a second."""

from __future__ import annotations

import signal
import time

import numpy as np
import pytest
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from std_msgs.msg import String

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import read_table_recording
from shake_ros.ros import interface, recorder_node
from shake_ros.ros.conversions import SECOND, codec
from shake_ros.ros.loop import build_node, ros_context

from .recording_processes import end, own_node, process, wait_until

SAMPLES = 5000
TOPICS = (interface.JOINT_STATES, interface.VALVE_COMMAND)


def publish_samples(node, count, lockstep=True, pause=0.0):
    """Positions and commands sin(k), stamped 1 s + k ms (lock-step) or by the wall clock."""
    publishers = [node.create_publisher(topic.type, topic.name, topic.qos(lockstep)) for topic in TOPICS]
    for topic in TOPICS:
        wait_until(lambda topic=topic: node.count_subscribers(topic.name) > 0, f"recorder on {topic.name}")
    if not lockstep:
        time.sleep(0.5)  # volatile writers: the match must be complete on both sides
    codecs = [codec(topic) for topic in TOPICS]
    for k in range(count):
        stamp = SECOND + k * 1_000_000 if lockstep else time.time_ns()
        for publisher, one in zip(publishers, codecs, strict=True):
            publisher.publish(one.encode(stamp, (float(np.sin(k)),)))
        if pause:
            time.sleep(pause)
    return publishers


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_every_lockstep_message_is_recorded_and_a_signal_ends_the_file_properly(ros_domain, tmp_path, number):
    with process("recorder", output=str(tmp_path / "run"), lockstep=True) as recorder, own_node(ros_domain) as node:
        for publisher in publish_samples(node, SAMPLES):
            assert publisher.wait_for_all_acked(Duration(seconds=20.0))
        assert end(recorder, number) == 0
    recording = read_table_recording(tmp_path / "run")
    assert np.array_equal(recording.position, np.sin(np.arange(SAMPLES)))
    assert np.array_equal(recording.valve_command, recording.position)
    assert recording.findings == ()
    assert recording.provenance.complete
    with AnyReader([tmp_path / "run"]) as reader:  # lock-step: the time of receipt is the stamp
        times = [t for connection, t, _ in reader.messages() if connection.topic == "/shake/joint_states"]
    assert min(times) >= SECOND
    assert max(times) == SECOND + (SAMPLES - 1) * 1_000_000


def test_a_kill_costs_less_than_a_second_and_the_recording_is_recovered(ros_domain, tmp_path, capsys):
    path = tmp_path / "run"
    with process("recorder", output=str(path)) as recorder, own_node(ros_domain) as node:
        publish_samples(node, 2000, lockstep=False, pause=0.001)
        killed = time.time_ns()
        recorder.kill()
        recorder.wait()
    recording = read_table_recording(path)
    last = recording.provenance.start_stamp + recording.time[-1] * 1e9
    assert (killed - last) * 1e-9 < 1.0
    assert not recording.provenance.complete
    assert recorder_node.main(["--recover", str(path)]) == 0
    assert "messages recovered" in capsys.readouterr().out
    again = read_table_recording(path)
    assert again.provenance.complete
    assert np.array_equal(again.position, recording.position)


def test_topics_outside_of_the_interface_are_found_when_somebody_publishes_them(ros_domain, tmp_path):
    path = tmp_path / "run"
    with process("recorder", output=str(path), topics="/chatter") as recorder, own_node(ros_domain) as node:
        profile = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        publisher = node.create_publisher(String, "/chatter", profile)
        wait_until(lambda: node.count_subscribers("/chatter") > 0, "recorder on /chatter")
        time.sleep(0.5)
        for k in range(20):
            publisher.publish(String(data=f"hello {k}"))
            time.sleep(0.01)
        assert end(recorder) == 0
    with AnyReader([path]) as reader:
        texts = [reader.deserialize(raw, connection.msgtype).data for connection, _, raw in reader.messages()]
    assert texts == [f"hello {k}" for k in range(20)]


def test_lost_samples_show_on_diagnostics(ros_domain, tmp_path):
    with ros_context([], domain_id=ros_domain) as context:
        arguments = ["--ros-args", "-p", f"output:={tmp_path / 'run'}", "-p", "lockstep:=true"]
        recorder = build_node(recorder_node.build, "recorder", context, arguments)
        receive = next(one for one in recorder.receptions if one.name == "/shake/joint_states").arrived
        for k in (0, 1, 5, 5):
            receive(codec(interface.JOINT_STATES).encode(SECOND + k * 1_000_000, (0.0,)))
        values = {item.key: item.value for item in recorder.frame.diagnostics.status().values}
        recorder.finish()
        recorder.frame.close()
    assert values["joint_states.lost"] == "3"
    assert values["joint_states.doubled"] == "1"
    assert values["joint_states.count"] == "4"


def test_a_topic_that_comes_late_in_lockstep_is_on_the_same_clock(ros_domain, tmp_path):
    with ros_context([], domain_id=ros_domain) as context:
        arguments = ["--ros-args", "-p", f"output:={tmp_path / 'run'}", "-p", "lockstep:=true"]
        recorder = build_node(recorder_node.build, "recorder", context, arguments)
        arrived = {one.name: one.arrived for one in recorder.receptions}
        for topic in TOPICS:  # the commands' writer is discovered when all positions have come
            for k in range(SAMPLES):
                arrived[f"/shake/{topic.name}"](codec(topic).encode(SECOND + k * 1_000_000, (float(np.sin(k)),)))
        recorder.finish()
        recorder.frame.close()
    recording = read_table_recording(tmp_path / "run")
    assert recording.findings == ()
    assert np.array_equal(recording.valve_command, recording.position)


@pytest.mark.parametrize(
    ("parameter", "words"), [("compression:=best", "compression"), ("flush_every:=100.0", "outside 0.01 … 10")]
)
def test_wrong_parameters_are_refused(ros_domain, tmp_path, parameter, words):
    arguments = ["--ros-args", "-p", f"output:={tmp_path / 'run'}", "-p", parameter]
    with ros_context([], domain_id=ros_domain) as context, pytest.raises(ShakeError, match=words):
        build_node(recorder_node.build, "recorder", context, arguments)


def test_an_existing_recording_is_not_overwritten(ros_domain, tmp_path):
    (tmp_path / "run").mkdir()
    arguments = ["--ros-args", "-p", f"output:={tmp_path / 'run'}"]
    with ros_context([], domain_id=ros_domain) as context, pytest.raises(ShakeError, match="exists already"):
        build_node(recorder_node.build, "recorder", context, arguments)


def test_recovering_what_is_no_recording_is_one_line(tmp_path):
    with pytest.raises(ShakeError, match="no such recording"):
        recorder_node.main(["--recover", str(tmp_path / "nowhere")])
