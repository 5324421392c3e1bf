"""Recordings on disk → records that a fit takes, each gapless segment by itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shake_ros.core.identification.recordings import Record
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording, read_table_recording

SHORTEST = 1.0  # a segment shorter than this tells nothing of the dynamics [s]


def fit_records(recording: TableRecording) -> list[Record]:
    """The segments of a recording that are long enough to fit; a gap is never bridged.

    Raises
    ------
    ShakeError : where no segment is long enough.
    """
    records = []
    for span in recording.segments:
        if (span.stop - span.start) * recording.sample_time < SHORTEST:
            continue
        acceleration = None if recording.acceleration is None else recording.acceleration[span]
        records.append(
            Record(
                recording.name,
                recording.sample_time,
                recording.valve_command[span],
                recording.position[span],
                acceleration,
            )
        )
    if not records:
        raise ShakeError(f"{recording.name}: no stretch of {SHORTEST:g} s without a gap")
    return records


def read_fit_records(paths: Sequence[Path | str]) -> tuple[list[Record], list[str]]:
    """Records of several recordings, and the findings of reading them, a line each.

    Raises
    ------
    ShakeError : a recording cannot be used, or two have the same name.
    """
    records: list[Record] = []
    findings: list[str] = []
    names: set[str] = set()
    for path in paths:
        recording = read_table_recording(path)
        if recording.name in names:
            raise ShakeError(f"{path}: a recording named '{recording.name}' is given twice")
        names.add(recording.name)
        records += fit_records(recording)
        findings += [f"{recording.name}: {finding}" for finding in recording.findings]
    return records, findings
