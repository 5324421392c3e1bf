"""reproduce: the experiments of the thesis's chapter 6 run again, each claim beside what is found here."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.experiments import EXPERIMENTS
from shake_ros.api.reproduce import ALL, known_experiments, reproduce
from shake_ros.cli.reporting import add_figures, reporting
from shake_ros.data.results import check_folder


def parser() -> argparse.ArgumentParser:
    """The command line."""
    listed = "".join(f"\n  {name:<14}{entry.line}" for name, entry in EXPERIMENTS.items())
    p = argparse.ArgumentParser(
        prog="reproduce",
        description=f"{(__doc__ or '').strip()}\n\nexperiments:{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("names", nargs="*", default=[ALL], metavar="NAME", help="experiments, or all (default)")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for index.html, pages and claims")
    p.add_argument("--force", action="store_true", help="replace DIR")
    add_figures(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    names = known_experiments(given.names)
    check_folder(given.out, given.force)
    found = reproduce(*names)
    found.report(given.out, given.force, **reporting("reproduce", given, arguments))
    print(found)
    print(f"report: {given.out / 'index.html'}")
    return 0
