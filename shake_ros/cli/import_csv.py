"""`import_csv`: a laboratory's table of columns (text, or a .mat file's variables) → a recording on our topics."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shake_ros.core.quantities import ShakeError
from shake_ros.data.columns import Column, read_columns
from shake_ros.data.mat_file import read_mat_columns
from shake_ros.data.recordings import read_table_recording, write_table_recording

SIGNALS = {
    "command": "valve command, −1 … 1",
    "position": "position [m]",
    "acceleration": "acceleration [m/s²]",
    "force": "external force on the table [N]",
}


def parser() -> argparse.ArgumentParser:
    """Arguments of the command."""
    command = argparse.ArgumentParser(
        prog="import_csv",
        description="Columns of a text table become topics of a recording: valve_command, joint_states, imu, force.",
        epilog="COL is a column's name or its number from 1, or the name of a variable of a .mat file; "
        "'*scale' takes it to SI units, as in 'CHANNEL0*0.01'.",
    )
    command.add_argument("file", type=Path)
    clock = command.add_mutually_exclusive_group(required=True)
    clock.add_argument("--time", metavar="COL[*scale]", help="time [s]")
    clock.add_argument("--rate", type=float, metavar="HZ", help="sampling rate, where no column holds the time")
    for name, meaning in SIGNALS.items():
        required = name in ("command", "position")
        command.add_argument(f"--{name}", metavar="COL[*scale]", required=required, help=meaning)
    command.add_argument("--out", type=Path, required=True, metavar="BAG", help="folder of the recording")
    command.add_argument("--skip", type=int, metavar="N", help="lines above the table, where they are not found right")
    command.add_argument("--overwrite", action="store_true", help="replace an existing recording")
    return command


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    names = ("time", *SIGNALS)
    columns = {name: Column.parse(text) for name in names if (text := getattr(given, name)) is not None}
    if given.skip is not None and given.skip < 0:
        raise ShakeError(f"--skip {given.skip}: a number of lines is needed")
    is_mat = given.file.suffix.lower() == ".mat"
    values = read_mat_columns(given.file, columns) if is_mat else read_columns(given.file, columns, given.skip)
    time = values["time"] if "time" in values else _steps(len(values["position"]), given.rate)
    _check_time(given.file, time)
    write_table_recording(
        given.out,
        time,
        values["command"],
        values["position"],
        values.get("acceleration"),
        force=values.get("force"),
        overwrite=given.overwrite,
    )
    recording = read_table_recording(given.out)
    print(f"{given.out}: {len(recording)} samples, every {recording.sample_time * 1e3:.6g} ms, {_topics(values)}")
    for finding in recording.findings:
        print(f"  {finding}")
    return 0


def _steps(count: int, rate: float) -> npt.NDArray[np.float64]:
    if not (np.isfinite(rate) and rate > 0):
        raise ShakeError(f"--rate {rate:g}: a positive number of hertz is needed")
    return np.arange(count) / rate


def _check_time(path: Path, time: npt.NDArray[np.float64]) -> None:
    """Time must be finite and rise from row to row, and there must be rows."""
    if len(time) < 2:
        raise ShakeError(f"{path}: {len(time)} rows of numbers, at least 2 are needed")
    if not np.isfinite(time).all():
        raise ShakeError(f"{path}: row {int(np.argmax(~np.isfinite(time))) + 1} of the table has no time")
    falls = np.diff(np.rint(time * 1e9)) <= 0
    if falls.any():
        row = int(np.argmax(falls)) + 2
        count = int(falls.sum())
        raise ShakeError(
            f"{path}: time does not rise at row {row} of the table ({time[row - 1]:.9g} s), {count} such rows"
        )


def _topics(values: dict[str, npt.NDArray[np.float64]]) -> str:
    return ", ".join(f"{name} {np.nanmin(x):.4g} … {np.nanmax(x):.4g}" for name, x in values.items() if name != "time")
