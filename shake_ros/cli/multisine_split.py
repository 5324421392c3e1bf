"""multisine_split: a response to repeated periods split into linear, even and odd nonlinear parts and noise."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.multisine_split import UNITS, multisine_split
from shake_ros.cli.reporting import add_take, source
from shake_ros.data.results import refuse_existing, writing

METHOD = """\
The excitation is the valve command. Without --period it is found where the command repeats itself. The first period is
left out where two remain (--skip changes that). Even and odd distortion are apart only where odd lines alone are
excited, and the odd part is known only where some odd lines are left out (grid: odd_random of the multisine)."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="multisine_split", description=__doc__, epilog=METHOD, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("bag", metavar="BAG", type=Path)
    add_take(p)
    p.add_argument("--period", type=float, metavar="T", help="length of a period [s] (default: found)")
    p.add_argument("--channel", choices=tuple(UNITS), default="acceleration")
    p.add_argument("--skip", type=int, metavar="N", help="periods left out at the start")
    p.add_argument("--plot", type=Path, metavar="PNG", help="also draw the lines")
    p.add_argument("--force", action="store_true", help="replace an existing figure")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    if given.plot is not None:
        refuse_existing(given.plot, force=given.force)
    found = multisine_split(source(given.bag, given), given.period, given.channel, given.skip)
    if given.plot is not None:
        with writing():
            found.plot().savefig(given.plot, dpi=110, format="png")
    print(found)
    return 0
