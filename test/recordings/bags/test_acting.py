"""A recording that holds the interlock's reports: what was recorded while the command did not act is left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import TableRecording, read_table_recording
from shake_ros.recordings.bags.table import said
from shake_ros.recordings.fit_records import fit_records

TYPES = get_typestore(Stores.ROS2_KILTED)
Report = tuple[float, dict[str, str]]


def report(values: dict[str, str], node: str = "plant") -> bytes:
    """A message as the nodes send it, by rosbags' own serialisation."""
    types = TYPES.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "")
    pairs = [types["diagnostic_msgs/msg/KeyValue"](key, value) for key, value in values.items()]
    status = [
        types["diagnostic_msgs/msg/DiagnosticStatus"](0, f"shake/{name}: {name}", "", f"shake/{name}", own)
        for name, own in (("observer", []), (node, pairs))
    ]
    message = types["diagnostic_msgs/msg/DiagnosticArray"](header, status)
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__))


def with_reports(source: Path, target: Path, reports: Sequence[Report]) -> Path:
    """A copy of a recording with reports at seconds from its start."""
    with AnyReader([source]) as reader, Writer(target, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {c.topic: writer.add_connection(c.topic, c.msgtype, typestore=TYPES) for c in reader.connections}
        spoken = writer.add_connection("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", typestore=TYPES)
        rows = [(stamp, topics[c.topic], bytes(raw)) for c, stamp, raw in reader.messages()]
        first = rows[0][0]
        rows += [(first + round(at * 1e9), spoken, report(values)) for at, values in reports]
        for stamp, connection, raw in sorted(rows, key=lambda row: row[0]):
            writer.write(connection, stamp, raw)
    return target


def says(passes: bool, span: float = 1.0) -> dict[str, str]:
    return {"mode": "realtime", "stage": "run", "passes": str(passes), "span": f"{span:.3f}"}


def read(make: Callable[..., Path], reports: Sequence[Report]) -> TableRecording:
    source = make("source")
    return read_table_recording(with_reports(source, source.with_name("run"), reports))


def test_what_was_recorded_before_commands_act_and_in_a_hold_is_left_out(make: Callable[..., Path]) -> None:
    found = read(make, [(0.0005, says(False)), (0.5005, says(True, 0.0)), (0.9995, says(True)), (2.4995, says(False))])
    assert found.segments == (slice(1000, 2500),)
    (told,) = [str(f) for f in found.findings if f.kind == "idle"]
    assert told.startswith("/shake/valve_command: commands did not act in full") and "1500 of 3000 samples" in told
    (record,) = fit_records(found)
    np.testing.assert_array_equal(record.position, found.position[1000:2500])


def test_a_recording_in_which_no_command_acts_is_read_but_not_fitted(make: Callable[..., Path]) -> None:
    found = read(make, [(0.0005, says(True, 0.5))])
    assert found.segments == (slice(0, 3000),)
    with pytest.raises(ShakeError, match=r"run: /shake/valve_command: commands did not act in full .* on any sample"):
        fit_records(found)


@pytest.mark.parametrize("values", [{}, {"mode": "realtime"}, says(True), {"passes": "True", "span": "full"}])
def test_reports_without_an_interlock_or_of_one_that_passes_leave_nothing_out(
    make: Callable[..., Path], values: dict[str, str]
) -> None:
    found = read(make, [(0.1, values), (1.5, values)])
    assert found.segments == (slice(0, 3000),)
    assert found.findings == ()


def test_a_first_report_of_a_table_that_nobody_commands_yet_leaves_nothing_out(make: Callable[..., Path]) -> None:
    """Before the first command the master gain is 0: its report may be received after the first samples."""
    found = read(make, [(0.0005, says(True, 0.0)), (0.0035, says(True))])
    assert found.segments == (slice(0, 3000),)
    assert found.findings == ()


def test_bytes_that_are_no_report_say_nothing() -> None:
    assert said(b"\x00\x01\x00\x00\xff\xff") is None
    assert said(report(says(True))) is True
