"""`demo`: the main job end to end: measured data, the loop over DDS, the missing effect, tracking before and after."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.demo import demo
from shake_ros.cli.reporting import add_figures, reporting


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="demo", description=__doc__)
    command.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR", help="result folder")
    command.add_argument("--seed", type=int, default=1, help="chooses the hidden effect and the table's own values")
    command.add_argument("--hidden", metavar="EFFECT", help="hide this effect instead of the one the seed chooses")
    add_figures(command)
    given = command.parse_args(list(arguments))
    try:
        result = demo(given.out, seed=given.seed, hidden=given.hidden, **reporting("demo", given, arguments))
    except RuntimeError as error:  # a node of the graph died or is stuck
        print(f"shake_ros demo: {error}", file=sys.stderr)
        return 1
    print(result, end="")
    print(f"report: {given.out / 'report.html'}")
    return 0
