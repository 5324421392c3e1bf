"""`import_csv`: a laboratory's table of columns (text, or a .mat file's variables) → a recording on our topics."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shake_ros.api.import_csv import SIGNALS, import_csv


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
    recording = import_csv(**vars(given))
    ranges = ", ".join(
        f"{name} {np.nanmin(values):.4g} … {np.nanmax(values):.4g}"
        for name in SIGNALS
        if (values := recording.valve_command if name == "command" else getattr(recording, name)) is not None
    )
    print(f"{given.out}: {len(recording)} samples, every {recording.sample_time * 1e3:.6g} ms, {ranges}")
    for finding in recording.findings:
        print(f"  {finding}")
    return 0
