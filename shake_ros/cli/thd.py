"""thd: the harmonics of a recording's acceleration and their total harmonic distortion (6.1)."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.thd import thd
from shake_ros.cli.reporting import add_take, source

METHOD = """\
The fundamental is fitted to the acceleration, within 1 % of that of the reference or, where there is none, of the valve
command, unless --frequency names it.
Without --start and --stop, the part is taken in which that signal keeps its amplitude; of it, whole periods.
Amplitudes come from a least-squares fit of all harmonics below half the sampling rate (or of --harmonics N)."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="thd",
        description="Print the harmonics of the acceleration in recordings, and their distortion.",
        epilog=METHOD,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("bags", nargs="+", metavar="BAG", type=Path)
    add_take(p)
    p.add_argument("--frequency", type=float, help="fundamental [Hz] (default: found)")
    p.add_argument("--harmonics", type=int, metavar="N", help="orders to fit and to print (default: all, 15 printed)")
    p.add_argument("--start", type=float, metavar="T", help="from this time of the recording on [s]")
    p.add_argument("--stop", type=float, metavar="T", help="up to this time of the recording [s]")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    found = [thd(source(bag, given), given.frequency, given.harmonics, given.start, given.stop) for bag in given.bags]
    print("\n\n".join(map(repr, found)))
    return 0
