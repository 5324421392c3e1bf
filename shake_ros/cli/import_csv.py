"""`import_csv`: a laboratory's table of columns (text, or a .mat file's variables) → a recording on our topics."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from shake_ros.api.import_csv import OF_SECOND, SIGNALS, import_csv, import_proposal
from shake_ros.core.quantities import ShakeError

ALSO = "--also"
NEEDED = {
    "command": "what drives the valve; a motion alone does not tell a table",
    "position": "velocity and place of the table come from it; an acceleration alone tells neither",
    "out": "the folder of the recording",
}


def parser() -> argparse.ArgumentParser:
    """Arguments of the command, and of its first file."""
    command = argparse.ArgumentParser(
        prog="import_csv",
        usage="import_csv FILE | FILE --time COL --command COL --position COL [--acceleration COL …] --out BAG "
        f"[options] [{ALSO} FILE --time COL --acceleration COL …]",
        description="Columns of a table (text, .xlsx, .tdms, .mat) become topics of a recording: valve_command, "
        "joint_states, imu, force, pressures. FILE alone prints its columns and the command that imports them.",
        epilog="COL is a column's name or its number from 1, or the name of a variable of a .mat file. The unit in its "
        "heading takes it to SI units; '*scale' stands in for that, and '*scale+offset' moves its zero as well: "
        "'CHANNEL0*0.01', 'mA*0.125-1.5' for 4 to 20 mA. "
        f"Options behind {ALSO} belong to that file: its time and its acceleration, and force and pressures if it has "
        "them. Where its clock stands to the first is found by the correlation of acceleration and position, and told.",
    )
    _add_file(command, SIGNALS)
    command.add_argument("--out", type=Path, metavar="BAG", help="folder of the recording")
    command.add_argument(
        "--bridge", type=int, default=0, metavar="N", help="fill gaps of up to N samples by interpolation"
    )
    command.add_argument(
        "--same-clock", action="store_true", help=f"the time of the files behind {ALSO} is that of the first"
    )
    command.add_argument("--overwrite", action="store_true", help="replace an existing recording")
    return command


def _add_file(command: argparse.ArgumentParser, signals: Iterable[str]) -> None:
    """The arguments of one file."""
    command.add_argument("file", type=Path)
    clock = command.add_mutually_exclusive_group()
    clock.add_argument("--time", metavar="COL[*scale]", help="time [s]")
    clock.add_argument("--rate", type=float, metavar="HZ", help="sampling rate, where no column holds the time")
    for name in signals:
        command.add_argument(f"--{name}", metavar="COL[*scale[+offset]]", help=SIGNALS[name])
    command.add_argument("--skip", type=int, metavar="N", help="lines above the table, where they are not found right")
    command.add_argument("--decimal", choices=(".", ","), default="", help="where the numbers do not decide it")


def read_arguments(arguments: Sequence[str]) -> argparse.Namespace:
    """The arguments of the first file, and in `also` those of each further one."""
    places = [i for i, word in enumerate(arguments) if word == ALSO]
    first, *others = (arguments[a:b] for a, b in pairwise([0, *places, len(arguments)]))
    second = argparse.ArgumentParser(prog=f"import_csv {ALSO}", allow_abbrev=False)
    _add_file(second, OF_SECOND)
    read, rest = [], list[str]()
    for words in others:
        more, left = second.parse_known_args(words[1:])  # --out and the like may stand behind it too
        read.append({name: value for name, value in vars(more).items() if value is not None})
        rest += left
    named = parser().parse_args([*first, *rest])
    named.also = read
    return named


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = read_arguments(list(arguments))
    if not any(getattr(given, name) is not None for name in ("time", "rate", "out", *SIGNALS)):
        print(import_proposal(given.file, skip=given.skip, decimal=given.decimal))
        return 0
    for name, why in NEEDED.items():
        if getattr(given, name) is None:
            raise ShakeError(f"{given.file}: --{name} is needed: {why}")
    recording = import_csv(**vars(given))
    ranges = ", ".join(
        f"{name} {np.nanmin(values):.4g} … {np.nanmax(values):.4g}"
        for name in SIGNALS
        if (values := recording.valve_command if name == "command" else getattr(recording, name)) is not None
    )
    print(f"{given.out}: {len(recording)} samples, every {recording.sample_time * 1e3:.6g} ms, {ranges}")
    for finding in recording.findings:
        print(f"  {finding}")
    if any(getattr(recording, name) is not None for name in SIGNALS if name.startswith("pressure")):
        print("  pressures: kept in the recording; identify and close_loop do not use them")
    return 0
