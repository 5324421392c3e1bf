"""compare: the controllers side by side on the same references, loads and perturbed tables."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.compare import compare
from shake_ros.cli.reporting import add_figures, reporting
from shake_ros.data.results import refuse_existing


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="compare", description=__doc__)
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="result folder")
    p.add_argument("--quick", action="store_true", help="two references, one load, four perturbed tables")
    p.add_argument("--settings", default="default", metavar="NAME", help="config/compare/NAME.yaml or a file")
    p.add_argument(
        "--record", nargs="+", default=(), metavar="FILE", help="accelerograms in place of the synthetic earthquakes"
    )
    p.add_argument("--only", nargs="+", metavar="LABEL", help="these controllers of the settings alone")
    p.add_argument("--force", action="store_true", help="replace DIR")
    add_figures(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    refuse_existing(given.out, force=given.force)
    began, spent = time.monotonic(), time.process_time()
    found = compare(given.settings, quick=given.quick, records=given.record, only=given.only)
    found.report(given.out, given.force, **reporting("compare", given, arguments))
    wall, processor = time.monotonic() - began, time.process_time() - spent
    print(found)
    print(f"{len(found.outcomes)} loops in {wall:.0f} s, {processor:.0f} s of processor time")
    print(f"report: {given.out / 'report.html'}")
    return 0
