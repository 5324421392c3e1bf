"""sensitivity: what θ_5, θ_6 and θ_7 of (6.15) do to the table, figures 6.19–6.24 of the thesis drawn again."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.sensitivity import check_free, sensitivity


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="sensitivity", description="Study single parameters of (6.15): figures 6.19–6.24.")
    p.add_argument("--study", default="thesis", metavar="NAME", help="config/sensitivity/NAME.yaml or a file")
    p.add_argument("--table", help="another table than the study's")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the figures and sensitivity.json")
    p.add_argument("--force", action="store_true", help="overwrite")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    check_free(given.out, given.force)
    found = sensitivity(given.study, given.table)
    found.report(given.out, given.force)
    print(found)
    print(f"written: {given.out}")
    return 0
