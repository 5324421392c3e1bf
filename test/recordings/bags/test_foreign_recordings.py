"""Recordings that others wrote: each opens, or is refused for the true reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import read_table_recording
from shake_ros.recordings.bags.bag import Bag

# message counts as the files themselves declare them; `usable` leaves service events and other encodings out
RECORDINGS = [
    ("geocamxyz/test_bag_mcap", 188, 188),
    ("geocamxyz/test_bag_sqlite3", 188, 188),
    ("jinbeizame007/array_msgs", 2, 2),
    ("jinbeizame007/base_msgs", 3, 3),
    ("ros2-rosbag2/cpp_bags/only_services.mcap", 12, 0),
    ("ros2-rosbag2/cpp_bags/only_topics.mcap", 7, 7),
    ("ros2-rosbag2/cpp_bags/topics_and_services.db3", 13, 7),
    ("ros2-rosbag2/cpp_bags/topics_and_services.mcap", 13, 7),
    ("ros2-rosbag2/mcap_bag_with_topics_and_service_events", 10, 2),
    ("ros2-rosbag2/mcap_cdr_test", 7, 7),
    ("ros2-rosbag2/mcap_convert_a", 150, 150),
    ("ros2-rosbag2/mcap_convert_b", 75, 75),
    ("ros2-rosbag2/mcap_talker", 20, 20),
    ("ros2-rosbag2/mcap_test_bag_for_seek", 5, 5),
    ("ros2-rosbag2/mcap_wbag", 6074, 6074),
    ("ros2-rosbag2/mcap_wrong_rmw_test", 7, 0),
    ("ros2-rosbag2/sqlite3_cdr_test", 7, 7),
    ("ros2-rosbag2/sqlite3_talker", 20, 20),
]


@pytest.mark.parametrize(("name", "count", "usable"), RECORDINGS)
def test_every_message_of_a_foreign_recording_is_read(shared: Path, name: str, count: int, usable: int):
    with Bag(shared / "data/rosbag2" / name) as bag:
        assert bag.message_count == count
        assert sum(1 for _ in bag.messages()) == usable
        assert bag.complete
        assert {finding.kind for finding in bag.findings} <= {"skipped"}


def test_channels_that_cannot_be_used_say_why(shared: Path):
    with Bag(shared / "data/rosbag2/ros2-rosbag2/mcap_wrong_rmw_test") as bag:
        assert "/test_topic: is serialised as 'wrong_format', not as cdr; left out" in map(str, bag.findings)
    with Bag(shared / "data/rosbag2/ros2-rosbag2/cpp_bags/only_services.mcap") as bag:
        assert "service calls" in str(bag.findings[0])


def test_a_folder_of_several_recordings_is_refused_with_their_names(shared: Path):
    with pytest.raises(ShakeError, match="several recordings in one folder, name one of only_services"):
        Bag(shared / "data/rosbag2/ros2-rosbag2/cpp_bags")


def test_foreign_recordings_without_a_table_are_refused_with_what_they_hold(shared: Path):
    with pytest.raises(ShakeError, match="no topic 'joint_states'; the recording holds /parameter_events, /rosout"):
        read_table_recording(shared / "data/rosbag2/ros2-rosbag2/mcap_talker")


@pytest.mark.parametrize("run", ["learn_ladder", "learn_multisine", "hold_multisine", "hold_pulses"])
@pytest.mark.parametrize("table", ["s1", "s2", "s3", "s4", "s5", "s6"])
def test_sealed_recordings_are_one_segment_without_findings(shared: Path, table: str, run: str):
    recording = read_table_recording(shared / "sealed" / table / run)
    assert recording.sample_time == 0.001
    assert recording.segments == (slice(0, len(recording)),)
    assert recording.findings == ()
    assert recording.acceleration is not None
    assert len(recording) == {"learn_ladder": 17500, "learn_multisine": 15000}.get(run, 12000)


def test_sealed_values_are_those_that_an_independent_decoder_gives(shared: Path):
    path = shared / "sealed/s1/hold_pulses"
    recording = read_table_recording(path)
    values: dict[str, list[float]] = {"valve_command": [], "joint_states": [], "imu": []}
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            name = connection.topic.rsplit("/", 1)[-1]
            values[name].append(message.linear_acceleration.x if name == "imu" else message.position[0])
    assert np.array_equal(recording.valve_command, values["valve_command"])
    assert np.array_equal(recording.position, values["joint_states"])
    assert np.array_equal(recording.acceleration, values["imu"])
