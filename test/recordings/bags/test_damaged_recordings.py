"""Mutated recordings: whatever the bytes, a reader answers with data or with one ShakeError, soon."""

from __future__ import annotations

import random
import sqlite3
import warnings
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from benchmarks.recordings.raw import JOINT_STATE, STORE, joint_state
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import read_table_recording

from .conftest import table_arrays

MUTATIONS = 150


def mutated(data: bytes, chance: random.Random) -> bytes:
    """Bytes flipped, cut out, doubled or replaced by a huge number, at one to four places."""
    content = bytearray(data)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(max(len(content), 1))
        kind = chance.randrange(5)
        if not content:
            break
        if kind == 0:
            content[at] ^= 1 << chance.randrange(8)
        elif kind == 1:
            content[at : at + 8] = chance.randbytes(8)
        elif kind == 2:
            del content[at : at + chance.randrange(1, 200)]
        elif kind == 3:
            content[at:at] = content[at : at + chance.randrange(1, 200)]
        else:
            content[at : at + 8] = (2 ** chance.randrange(8, 64)).to_bytes(8, "little")
    return bytes(content or b"\0")


def changed(file: Path, statement: str) -> Path:
    """The same file after a statement of SQL."""
    connection = sqlite3.connect(file)
    connection.execute(statement)
    connection.commit()
    connection.close()
    return file


def read_or_refuse(path: Path) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            recording = read_table_recording(path)
        except ShakeError as error:
            return "refused" if "\n" not in str(error) else str(error)
    assert all(segment.stop - segment.start >= 2 for segment in recording.segments)
    return "read"


@pytest.mark.parametrize("compression", ["", "zstd"])
def test_a_mutated_mcap_recording_is_read_or_refused(make, compression):
    short = {name: values[:200] for name, values in table_arrays().items()}
    file = make(**short, compression=compression) / "run.mcap"
    data, chance = file.read_bytes(), random.Random(1)
    answers = []
    for _ in range(MUTATIONS):
        file.write_bytes(mutated(data, chance))
        answers.append(read_or_refuse(file.parent))
    assert {"read", "refused"} == set(answers)


def test_a_mutated_sqlite_recording_is_read_or_refused(tmp_path):
    with Writer(tmp_path / "run", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        names = ("valve_command", "joint_states")
        topics = [writer.add_connection(f"/t/{name}", JOINT_STATE, typestore=STORE) for name in names]
        for k in range(100):
            for topic in topics:
                writer.write(topic, 10**9 + k * 10**6, joint_state(10**9 + k * 10**6, {"table": 0.1}))
    file, chance = tmp_path / "run" / "run.db3", random.Random(2)
    data = file.read_bytes()
    for _ in range(MUTATIONS):
        file.write_bytes(mutated(data, chance))
        read_or_refuse(file.parent)


def test_mutated_metadata_do_not_hide_the_messages(make):
    short = {name: values[:50] for name, values in table_arrays().items()}
    file = make(**short) / "metadata.yaml"
    data, chance = file.read_bytes(), random.Random(3)
    for _ in range(MUTATIONS // 3):
        file.write_bytes(mutated(data, chance))
        read_or_refuse(file.parent)
    file.write_text("relative_file_paths: 3")
    assert read_or_refuse(file.parent) == "read"


def test_mutated_messages_in_a_sound_file_are_counted_not_trusted(tmp_path):
    from shake_ros.recordings.bags import BagWriter

    chance = random.Random(4)
    with BagWriter(tmp_path / "run") as writer:
        numbers = [writer.add_topic(f"/t/{name}", JOINT_STATE) for name in ("valve_command", "joint_states")]
        for k in range(2000):
            for number in numbers:
                data = joint_state(10**9 + k * 10**6, {"table": 0.001 * k})
                writer.write(number, k, mutated(data, chance) if chance.random() < 0.3 else data)
    recording = read_table_recording(tmp_path / "run")
    kinds = {finding.kind for finding in recording.findings}
    assert {"undecodable", "gap"} <= kinds


def sqlite_recording(folder: Path) -> Path:
    """A small recording of another writer; the path of its file."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for name in ("valve_command", "joint_states"):
            topic = writer.add_connection(f"/t/{name}", JOINT_STATE, typestore=STORE)
            for k in range(20):
                writer.write(topic, 10**9 + k * 10**6, joint_state(10**9 + k * 10**6, {"table": 0.01 * k}))
    return folder / f"{folder.name}.db3"


def test_a_message_without_a_byte_is_counted_as_undecodable(tmp_path):
    from shake_ros.recordings.bags import BagWriter

    with BagWriter(tmp_path / "run") as writer:
        for name in ("valve_command", "joint_states"):
            number = writer.add_topic(f"/t/{name}", JOINT_STATE)
            for k in range(20):
                stamp = 10**9 + k * 10**6
                writer.write(number, stamp, b"" if k == 7 else joint_state(stamp, {"table": 0.01 * k}))
    recording = read_table_recording(tmp_path / "run")
    assert len(recording) == 19
    assert [finding.kind for finding in recording.findings].count("undecodable") == 2


def test_a_time_of_receipt_before_1970_is_read(tmp_path):
    file = changed(sqlite_recording(tmp_path / "run"), "UPDATE messages SET timestamp = -1564475391 WHERE id = 3")
    assert read_or_refuse(file.parent) == "read"


def test_a_type_with_a_line_end_in_it_is_refused_on_one_line(tmp_path):
    change = "UPDATE topics SET type = 'a\nb' WHERE name = '/t/joint_states'"
    file = changed(sqlite_recording(tmp_path / "run"), change)
    assert read_or_refuse(file.parent) == "refused"
