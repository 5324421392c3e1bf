"""frequency_response: gain, delay and coherence between two signals of a recording, as a table and a plot."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.frequency_response import INPUTS, OUTPUTS, WINDOW, frequency_response
from shake_ros.cli.reporting import add_figures, add_take, reporting, source
from shake_ros.data.results import refuse_existing


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="frequency_response", description=__doc__)
    p.add_argument("bag", metavar="BAG", type=Path)
    add_take(p)
    p.add_argument("--input", choices=tuple(INPUTS), default="valve_command")
    p.add_argument("--output", choices=tuple(OUTPUTS), default="position")
    p.add_argument("--window", type=float, default=WINDOW, metavar="T", help=f"window [s] (default: {WINDOW:g})")
    p.add_argument("--at", type=float, nargs="+", metavar="HZ", help="frequencies of the table (default: 0.5 … 20 Hz)")
    p.add_argument("--out", type=Path, metavar="DIR", help="folder for report.json and report.html with the plot")
    p.add_argument("--force", action="store_true", help="replace an existing result folder")
    add_figures(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    if given.out is not None:
        refuse_existing(given.out, force=given.force)
    found = frequency_response(source(given.bag, given), given.input, given.output, given.window, given.at)
    if given.out is not None:
        found.report(given.out, given.force, **reporting("frequency_response", given, arguments))
    print(found)
    if given.out is not None:
        print(f"report: {given.out / 'report.html'}")
    return 0
