"""Our recordings: others open them, a kill costs at most what was not flushed, nothing is overwritten."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from benchmarks.recordings.raw import JOINT_STATE, joint_state
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import BagWriter, read_table_recording, recover, write_table_recording
from shake_ros.recordings.bags.bag import Bag

from .conftest import table_arrays

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("compression", ["", "zstd"])
def test_other_readers_open_our_recordings_and_find_every_message(make, compression):
    path = make(compression=compression)
    with AnyReader([path]) as reader:
        assert reader.message_count == 9000
        decoded = [(c.topic, reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages()]
    positions = [message.position[0] for topic, message in decoded if topic.endswith("joint_states")]
    assert np.array_equal(positions, table_arrays()["position"])
    with (path / "run.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary.statistics.message_count == 9000
        assert {schema.name for schema in summary.schemas.values()} == {JOINT_STATE, "sensor_msgs/msg/Imu"}
        assert all("float64" in schema.data.decode() for schema in summary.schemas.values())
        assert sum(1 for _ in reader.iter_messages(topics=["/shake/imu"])) == 3000
    assert summary.channels[1].metadata["topic_type_hash"].startswith("RIHS01_")


def test_an_empty_recording_is_valid(tmp_path):
    with BagWriter(tmp_path / "empty") as writer:
        writer.add_topic("/shake/imu", "sensor_msgs/msg/Imu")
    with AnyReader([tmp_path / "empty"]) as reader:
        assert reader.message_count == 0


def test_nothing_is_overwritten_unless_asked_and_then_only_a_recording(make, tmp_path):
    path = make()
    with pytest.raises(ShakeError, match="exists already"):
        make()
    make(overwrite=True, first_stamp=5_000_000_000)
    assert read_table_recording(path).provenance.start_stamp == 5_000_000_000
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "thesis.tex").write_text("years")
    for target in (precious, precious / "thesis.tex"):
        with pytest.raises(ShakeError, match="is not a recording; it is not overwritten"):
            BagWriter(target, overwrite=True)
    assert (precious / "thesis.tex").read_text() == "years"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"time": table_arrays()["time"][::-1]}, "time does not rise at row 1"),
        ({"position": np.zeros(5)}, r"'joint_states' has shape \(5, 1\), expected \(3000, 1\)"),
        ({"truth": np.zeros(3000)}, r"'truth' has shape \(3000, 1\), expected \(3000, 3\)"),
        ({"time": np.full(3000, np.nan)}, "finite"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_and_leave_nothing_behind(make, tmp_path, changes, words):
    with pytest.raises(ShakeError, match=words):
        make(**changes)
    assert not (tmp_path / "run").exists()


def test_a_recording_killed_with_sigkill_keeps_all_that_was_flushed_and_is_recovered(tmp_path):
    program = f"""
        import sys
        sys.path.insert(0, {str(ROOT)!r})
        from shake_ros.recordings.bags import BagWriter
        from shake_ros.recordings.bags.table_writer import template
        writer = BagWriter({str(tmp_path / "run")!r})
        numbers = [writer.add_topic(f"/shake/{{n}}", {JOINT_STATE!r}) for n in ("valve_command", "joint_states")]
        k = 0
        while True:
            for number, name in zip(numbers, ("valve_command", "joint_states")):
                data = bytearray(template(name))
                data[4:12] = (10**9 // 10**9).to_bytes(4, "little") + (k * 10**5).to_bytes(4, "little")
                writer.write(number, 10**9 + k * 10**5, bytes(data))
            k += 1
            if k % 500 == 0:
                writer.flush()
                print(k, flush=True)
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(program)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    flushed = 0
    for line in process.stdout:
        flushed = int(line)
        if flushed >= 3000:
            break
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    assert not (tmp_path / "run" / "metadata.yaml").exists()

    recording = read_table_recording(tmp_path / "run")
    assert len(recording) >= flushed
    assert not recording.provenance.complete
    assert "killed" in " ".join(str(finding) for finding in recording.findings)

    folder, count = recover(tmp_path / "run")
    assert folder == tmp_path / "run"
    assert (tmp_path / "run.killed").is_dir()
    with AnyReader([folder]) as reader:
        assert reader.message_count == count == sum(1 for _ in reader.messages()) >= 2 * flushed
    again = read_table_recording(folder)
    assert again.provenance.complete
    assert not any(finding.kind == "damage" for finding in again.findings)
    assert np.array_equal(again.time, recording.time)


@pytest.mark.parametrize("share", [0.999, 0.9, 0.5, 0.1])
def test_a_recording_cut_anywhere_keeps_what_precedes_the_cut(make, share):
    path = make()
    data = (path / "run.mcap").read_bytes()
    (path / "run.mcap").write_bytes(data[: int(len(data) * share)])
    recording = read_table_recording(path)
    assert len(recording) >= 3000 * (share - 0.08)
    assert np.array_equal(recording.position[: len(recording)], table_arrays()["position"][: len(recording)])
    assert "damage" in {finding.kind for finding in recording.findings}


def test_a_chunk_with_a_wrong_checksum_costs_that_chunk_only(make):
    path = make()
    data = bytearray((path / "run.mcap").read_bytes())
    data[len(data) // 2] ^= 0xFF
    (path / "run.mcap").write_bytes(data)
    recording = read_table_recording(path)
    assert len(recording.segments) == 2
    assert 2600 < len(recording) < 3000
    assert "checksum" in " ".join(str(finding) for finding in recording.findings)


def test_recovery_into_another_folder_leaves_the_source_alone(make, tmp_path):
    path = make()
    (path / "metadata.yaml").unlink()
    before = (path / "run.mcap").read_bytes()
    folder, count = recover(path, tmp_path / "whole")
    assert count == 9000
    assert folder == tmp_path / "whole"
    assert (path / "run.mcap").read_bytes() == before
    with Bag(folder) as bag:
        assert bag.findings == []


def test_a_bare_killed_file_is_recovered_into_a_folder(make, tmp_path):
    bare = tmp_path / "bare.mcap"
    bare.write_bytes((make() / "run.mcap").read_bytes()[:-1000])
    folder, _ = recover(bare)
    assert folder == tmp_path / "bare"
    assert len(read_table_recording(folder)) == 3000


def test_memory_of_the_writer_does_not_grow_with_the_messages(tmp_path):
    import tracemalloc

    data = joint_state(10**9, {"table": 0.1})
    with BagWriter(tmp_path / "long") as writer:
        number = writer.add_topic("/shake/joint_states", JOINT_STATE)
        for k in range(2000):
            writer.write(number, k, data)
        tracemalloc.start()
        for k in range(2000, 42000):
            writer.write(number, k, data)
        grown = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
    assert grown < 100_000  # 40 000 messages of 100 bytes; what stays is 100 bytes a chunk


def test_a_write_into_a_folder_that_cannot_be_made_is_one_clear_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ShakeError, match="cannot be written"):
        write_table_recording(tmp_path / "file" / "run", [0.0, 1.0], [0.0, 0.0], [0.0, 0.0])
