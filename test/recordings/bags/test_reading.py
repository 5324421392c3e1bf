"""Recordings of our own and of others: what is read, and what a reader says about what is wrong."""

from __future__ import annotations

import shutil
import sqlite3
import struct
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from benchmarks.recordings.raw import JOINT_STATE, STORE, joint_state
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import BagWriter, TableRecording, read_table_recording, write_table_recording
from shake_ros.recordings.bags.bag import Bag

from .conftest import table_arrays


def kinds(recording: TableRecording) -> set[str]:
    return {finding.kind for finding in recording.findings}


def text_of(recording: TableRecording, kind: str) -> str:
    return " | ".join(str(finding) for finding in recording.findings if finding.kind == kind)


def rewrite(source: Path, target: Path, change) -> Path:
    """Copy a recording, with `change(topic, i, stamped bytes)` giving the list of messages in place of message i."""
    with Bag(source) as bag, BagWriter(target) as writer:
        numbers = {topic.name: writer.add_topic(topic.name, topic.type) for topic in bag.topics.values()}
        seen = dict.fromkeys(numbers, 0)
        for message in bag.messages():
            for data in change(message.topic.rsplit("/", 1)[-1], seen[message.topic], message.data):
                writer.write(numbers[message.topic], message.received, data)
            seen[message.topic] += 1
    return target


def stamped(data: bytes, stamp: int) -> bytes:
    return data[:4] + struct.pack("<iI", stamp // 10**9, stamp % 10**9) + data[12:]


def test_what_was_written_is_read_back_to_the_bit(make, arrays):
    three = np.stack([arrays["position"], arrays["valve_command"], arrays["acceleration"]], axis=1)
    path = make(pressure_a=1e6 + arrays["position"], force=arrays["acceleration"], reference=three, truth=three)
    recording = read_table_recording(path)
    for name in ("valve_command", "position", "acceleration"):
        assert np.array_equal(getattr(recording, name), arrays[name])
    assert np.array_equal(recording.truth, three)
    assert np.array_equal(recording.force, arrays["acceleration"])
    assert recording.sample_time == 0.001
    assert recording.segments == (slice(0, 3000),)
    assert recording.findings == ()
    assert recording.estimate is None
    assert recording.provenance.topics["imu"] == "/shake/imu"
    assert recording.name == "run"


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE])
def test_recordings_of_another_writer_are_read_in_every_storage_and_compression(tmp_path, storage, mode):
    writer = Writer(tmp_path / "other", version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        command, state = (
            writer.add_connection(f"/lab/{name}", JOINT_STATE, typestore=STORE)
            for name in ("valve_command", "joint_states")
        )
        for k in range(50):
            stamp = 10**9 + k * 5_000_000
            writer.write(state, stamp, joint_state(stamp, {"table": 0.001 * k}))
            writer.write(command, stamp + 1000, joint_state(stamp, {"servo_valve": 0.01 * k}))
    recording = read_table_recording(tmp_path / "other")
    assert np.array_equal(recording.position, 0.001 * np.arange(50))
    assert np.array_equal(recording.valve_command, 0.01 * np.arange(50))
    assert recording.sample_time == 0.005
    assert recording.acceleration is None


def test_big_endian_messages_and_changing_layouts_are_read(tmp_path):
    with BagWriter(tmp_path / "odd") as writer:
        command, state = (writer.add_topic(f"/t/{name}", JOINT_STATE) for name in ("valve_command", "joint_states"))
        for k in range(20):
            stamp = 10**9 + k * 10**6
            names = {"other": -1.0, "table": 0.001 * k} if k % 2 else {"table": 0.001 * k, "other": -1.0}
            writer.write(state, stamp, joint_state(stamp, names, "f" * (k % 5), little_endian=k % 3 > 0))
            writer.write(command, stamp, joint_state(stamp, {"servo_valve": 0.5}))
    assert np.array_equal(read_table_recording(tmp_path / "odd").position, 0.001 * np.arange(20))


def test_split_recordings_are_one(make, tmp_path):
    first, second = make("a"), make("b", time=table_arrays()["time"] + 3.0, first_stamp=4_000_000_000)
    folder = tmp_path / "run_split"
    folder.mkdir()
    shutil.copy(first / "a.mcap", folder / "run_split_0.mcap")
    shutil.copy(second / "b.mcap", folder / "run_split_1.mcap")
    recording = read_table_recording(folder)
    assert len(recording) == 6000
    assert recording.segments == (slice(0, 6000),)
    assert kinds(recording) == {"damage"}


def test_a_bare_file_is_a_recording(make):
    recording = read_table_recording(make() / "run.mcap")
    assert recording.name == "run"
    assert len(recording) == 3000


def test_a_command_acts_from_its_stamp_until_the_next(make, tmp_path):
    # commands at 200 Hz for positions at 1 kHz: each holds for five samples
    slow = rewrite(make(), tmp_path / "slow", lambda t, i, d: [d] if t != "valve_command" or i % 5 == 0 else [])
    expected = np.repeat(table_arrays()["valve_command"][::5], 5)
    recording = read_table_recording(slow)
    assert np.array_equal(recording.valve_command, expected)
    assert recording.segments == (slice(0, 3000),)


def test_a_gap_in_the_positions_ends_a_segment_and_is_reported(make, tmp_path):
    path = rewrite(make(), tmp_path / "gap", lambda t, i, d: [] if t == "joint_states" and 1000 <= i < 1010 else [d])
    recording = read_table_recording(path)
    assert recording.segments == (slice(0, 1000), slice(1000, 2990))
    assert "1 gaps, about 10 samples missing; first after 0.999 s" in text_of(recording, "gap")
    assert np.allclose(np.diff(recording.longest.time), 0.001)


def test_a_gap_in_the_commands_is_not_bridged(make, tmp_path):
    path = rewrite(make(), tmp_path / "gap", lambda t, i, d: [] if t == "valve_command" and 1000 <= i < 1020 else [d])
    recording = read_table_recording(path)
    assert recording.segments == (slice(0, 1000), slice(1020, 3000))
    assert np.isnan(recording.valve_command[1000:1020]).all()
    assert "valve_command" in text_of(recording, "gap")


def test_lost_acceleration_ends_a_segment_but_lost_reference_does_not(make, arrays, tmp_path):
    path = make(reference=np.tile(arrays["position"][:, None], 3))
    cut = rewrite(path, tmp_path / "cut", lambda t, i, d: [] if t in ("imu", "reference") and i == 7 else [d])
    recording = read_table_recording(cut)
    assert recording.segments == (slice(0, 7), slice(8, 3000))
    only = rewrite(path, tmp_path / "only", lambda t, i, d: [] if t == "reference" and i == 7 else [d])
    recording = read_table_recording(only)
    assert recording.segments == (slice(0, 3000),)
    assert np.isnan(recording.reference[7]).all()
    assert "reference" in text_of(recording, "gap")


def test_duplicates_and_samples_out_of_order_are_put_right_and_counted(make, tmp_path):
    held: list[bytes] = []

    def change(topic, i, data):
        if topic != "joint_states":
            return [data]
        if i == 500:
            held.append(data)
            return []
        return [data, held[0]] if i == 501 else [data, data] if i == 900 else [data]

    recording = read_table_recording(rewrite(make(), tmp_path / "odd", change))
    assert np.array_equal(recording.position, table_arrays()["position"])
    assert "1 stamps go back in time" in text_of(recording, "reversed_time")
    assert "1 stamps occur twice, 0 with another value" in text_of(recording, "duplicate")


def test_a_second_run_in_the_same_recording_does_not_mix_into_the_first(make, tmp_path):
    path = rewrite(make(), tmp_path / "twice", lambda t, i, d: [stamped(d, 10**9 + (i % 2000) * 10**6)])
    recording = read_table_recording(path)
    assert np.array_equal(recording.position, table_arrays()["position"][:2000])
    assert np.array_equal(recording.valve_command, table_arrays()["valve_command"][:2000])
    assert "1000 samples of others are left out" in text_of(recording, "restart")


def test_one_stray_stamp_costs_one_sample(make, tmp_path):
    path = rewrite(make(), tmp_path / "s", lambda t, i, d: [stamped(d, 2 * 10**18) if t[0] == "j" and i == 50 else d])
    recording = read_table_recording(path)
    assert recording.segments == (slice(0, 50), slice(50, 2999))
    assert "far from" in text_of(recording, "reversed_time")


def test_not_a_number_ends_a_segment_and_is_reported(make, arrays):
    command, position = arrays["valve_command"].copy(), arrays["position"].copy()
    command[100:103] = np.nan
    position[2000] = np.inf
    recording = read_table_recording(make(valve_command=command, position=position))
    assert recording.segments == (slice(0, 100), slice(103, 2000), slice(2001, 3000))
    assert "/shake/valve_command: 3 samples have no finite value; first at 0.1 s" in text_of(recording, "not_a_number")
    assert "/shake/joint_states: 1 samples" in text_of(recording, "not_a_number")


def test_messages_without_a_stamp_are_left_out_and_counted(make, tmp_path):
    path = rewrite(make(), tmp_path / "z", lambda t, i, d: [stamped(d, 0) if t == "imu" and 10 <= i < 15 else d])
    recording = read_table_recording(path)
    assert "5 messages have no stamp (first: message 10)" in text_of(recording, "missing_stamp")
    assert recording.segments == (slice(0, 10), slice(15, 3000))


def test_stamps_may_start_at_zero(make):
    recording = read_table_recording(make(first_stamp=0))
    assert len(recording) == 3000
    assert recording.findings == ()


def test_a_recording_without_any_stamp_is_refused_with_that_reason(make, tmp_path):
    path = rewrite(make(), tmp_path / "z", lambda t, i, d: [stamped(d, 0)])
    with pytest.raises(ShakeError, match=r"joint_states' has 0 usable stamped samples.*3000 messages have no stamp"):
        read_table_recording(path)


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"position": 50 * np.sin(np.arange(3000) * 0.01)}, "unit", "millimetres"),
        ({"valve_command": 10 * np.sin(np.arange(3000) * 0.01)}, "unit", "volts"),
        ({"acceleration": table_arrays()["acceleration"] / 9.81}, "unit", "g instead of m/s²"),
        ({"pressure_a": np.full(3000, 90.0) + np.arange(3000)}, "unit", "bar"),
        ({"valve_command": np.clip(np.cos(np.arange(3000) * 0.01), -0.5, 0.5)}, "clipping", "extreme value 0.5"),
        ({"position": np.full(3000, 0.01)}, "constant", "same value 0.01"),
    ],
)
def test_suspicious_sizes_are_reported_by_name(make, changes, kind, words):
    assert words in text_of(read_table_recording(make(**changes)), kind)


def test_two_candidates_are_an_error_that_lists_both(make, tmp_path):
    with BagWriter(tmp_path / "two") as writer:
        for name in ("/a/joint_states", "/b/joint_states", "/a/valve_command"):
            number = writer.add_topic(name, JOINT_STATE)
            writer.write(number, 10**9, joint_state(10**9, {"table": 0.0}))
    with pytest.raises(ShakeError, match="two topics end in 'joint_states': /a/joint_states and /b/joint_states"):
        read_table_recording(tmp_path / "two")


def test_a_missing_topic_is_named_with_those_that_are_there(make, tmp_path):
    path = rewrite(make(), tmp_path / "none", lambda t, i, d: [] if t == "valve_command" else [d])
    with pytest.raises(ShakeError, match="topic '/shake/valve_command' holds no message"):
        read_table_recording(path)
    with BagWriter(tmp_path / "empty") as writer:
        writer.add_topic("/shake/imu", "sensor_msgs/msg/Imu")
    with pytest.raises(ShakeError, match="no topic 'joint_states'; the recording holds /shake/imu"):
        read_table_recording(tmp_path / "empty")


def test_a_topic_of_another_type_is_refused_by_both_types(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        number = writer.add_topic("/shake/joint_states", "std_msgs/msg/Float64")
        writer.write(number, 10**9, b"\0\1\0\0" + bytes(8))
    with pytest.raises(ShakeError, match="joint_states' is std_msgs/msg/Float64, expected sensor_msgs/msg/JointState"):
        read_table_recording(tmp_path / "bag")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"#ROSBAG V2.0\n" + bytes(100), "ROS 1 bag"),
        (b"time,command\n0,1\n", "neither MCAP nor SQLite"),
        (b"", "is empty"),
    ],
)
def test_files_of_another_format_are_refused_by_name(tmp_path, content, words):
    (tmp_path / "x.mcap").write_bytes(content)
    with pytest.raises(ShakeError, match=words):
        read_table_recording(tmp_path / "x.mcap")


def test_paths_that_are_no_recording_are_refused(tmp_path):
    with pytest.raises(ShakeError, match="no such recording"):
        read_table_recording(tmp_path / "nowhere")
    with pytest.raises(ShakeError, match="not a recording"):
        read_table_recording(tmp_path)


def test_the_write_ahead_log_of_a_killed_sqlite_recorder_is_part_of_the_recording(make, tmp_path):
    folder = tmp_path / "killed"
    folder.mkdir()
    connection = sqlite3.connect(tmp_path / "live.db3")
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, "
        "offered_qos_profiles TEXT)"
    )
    connection.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    for number, name in enumerate(("valve_command", "joint_states"), start=1):
        connection.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", (number, f"/t/{name}", JOINT_STATE))
        for k in range(100):
            stamp = 10**9 + k * 10**6
            data = joint_state(stamp, {"table": 0.001 * k})
            connection.execute("INSERT INTO messages VALUES(NULL, ?, ?, ?)", (number, stamp, data))
    connection.commit()
    for suffix in ("", "-wal"):  # as they stand on the disk while the recorder still holds them
        shutil.copy(tmp_path / f"live.db3{suffix}", folder / f"killed.db3{suffix}")
    connection.close()
    before = (folder / "killed.db3").read_bytes()
    assert len(read_table_recording(folder)) == 100
    assert (folder / "killed.db3").read_bytes() == before


@pytest.mark.parametrize("frequency", [1.0, 5.0, 20.0, 40.0, 49.0])
def test_a_clean_sine_is_in_the_units_it_says(tmp_path, frequency):
    time, w = np.arange(5000) / 500.0, 2.0 * np.pi * frequency
    arrays = {"valve_command": np.cos(w * time), "position": 0.01 * np.sin(w * time)}
    write_table_recording(tmp_path / "sine", time, **arrays, acceleration=-0.01 * w**2 * np.sin(w * time))
    assert not [f for f in read_table_recording(tmp_path / "sine").findings if "curvature" in f.text]
    write_table_recording(tmp_path / "in_g", time, **arrays, acceleration=-0.01 / 9.80665 * w**2 * np.sin(w * time))
    told = [f.text for f in read_table_recording(tmp_path / "in_g").findings if "curvature" in f.text]
    assert bool(told) == (frequency <= 20.0)


def test_an_accelerometer_without_a_value_is_refused_without_a_warning(tmp_path):
    time = np.arange(500) / 100.0
    arrays = {"valve_command": np.cos(time), "position": np.sin(time)}
    write_table_recording(tmp_path / "empty", time, **arrays, acceleration=np.full(500, np.nan))
    with pytest.raises(ShakeError, match="imu: 500 samples have no finite value"):
        read_table_recording(tmp_path / "empty")
