"""campaign: a study of many independent fits or loops: on this machine's cores or on a cluster, each row once, in one
file that an interrupted study goes on with; tables and figures of what was found."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shake_ros.api.campaign import campaign
from shake_ros.cli.reporting import add_figures, reporting
from shake_ros.core.quantities import ShakeError
from shake_ros.settings import value_of


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="campaign", description=__doc__)
    p.add_argument("study", metavar="STUDY", help="config/studies/STUDY.yaml or a file")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the rows; of an earlier start too")
    p.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="NAME=VALUE", help="other values of the study, in YAML"
    )
    p.add_argument("--workers", type=int, metavar="N", help="processes on this machine (default: one for each core)")
    p.add_argument(
        "--engine", metavar="ADDRESS", help="a Dask scheduler: tls://HOST:PORT, or tcp://HOST:PORT on this machine"
    )
    p.add_argument("--minutes", type=float, metavar="M", help="begin no further row after so long; 0: report alone")
    p.add_argument("--retry", action="store_true", help="run the rows again that failed")
    p.add_argument("--compare", type=Path, metavar="OTHER", help="folder of an older campaign of the same study")
    add_figures(p)
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    if given.minutes is not None and not 0.0 <= given.minutes < float("inf"):
        raise ShakeError(f"--minutes {given.minutes:g}: must be 0 or more")
    options = {name: getattr(given, name) for name in ("engine", "workers", "minutes", "retry")}
    try:
        found = campaign(given.study, given.out, changes=changes_of(given.set), **options)
    except KeyboardInterrupt:
        print(f"stopped; what was finished is in {given.out}, and the same command goes on", file=sys.stderr)
        raise
    page = found.report(given.compare, **reporting("campaign", given, arguments))
    print(found)
    print(f"report: {page}")
    return 1 if found.failed else 0


def changes_of(given: Sequence[str]) -> dict[str, Any]:
    """NAME=VALUE by name, the values read as YAML."""
    found = {}
    for text in given:
        name, sign, value = text.partition("=")
        if not sign or not name:
            raise ShakeError(f"--set {text}: is not NAME=VALUE")
        found[name] = value_of(value, f"--set {name}")
    return found
