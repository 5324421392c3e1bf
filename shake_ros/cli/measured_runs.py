"""`measured_runs`: the real table's harmonics, tables 6.1 and 6.2 of the thesis, against printed and fitted models."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.measured_runs import ALL, DEFAULT_RUNS, THESIS_EXTENSION, measured_runs
from shake_ros.cli.reporting import add_figures, reporting
from shake_ros.data.results import check_folder


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="measured_runs", description=__doc__)
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the report, tables and the fit")
    p.add_argument(
        "--runs", default=DEFAULT_RUNS, metavar="FILE", help="amplitudes: a name of config/measured or a YAML file"
    )
    p.add_argument(
        "--extend",
        nargs="+",
        default=[THESIS_EXTENSION],
        metavar="NAME",
        help=f"extensions of the declared model to fit, of config/measured/variants.yaml, or {ALL} "
        f"(default: {THESIS_EXTENSION})",
    )
    p.add_argument(
        "--second", nargs="+", default=[], metavar="NAME", help=f"extensions to try on top of the best, or {ALL}"
    )
    p.add_argument("--force", action="store_true", help="replace an existing result folder")
    add_figures(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    check_folder(given.out, given.force)
    found = measured_runs(given.runs, given.extend, given.second)
    found.report(given.out, given.force, **reporting("measured_runs", given, arguments))
    print(found)
    print(f"report: {given.out / 'report.html'}")
    return 0
