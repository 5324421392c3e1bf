"""tune: the gains of a controller that minimise (6.42) over loads and perturbed tables, as a new configuration."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.loops import MODELS
from shake_ros.api.tune import check_target, tune


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="tune", description=__doc__)
    p.add_argument(
        "controller", metavar="CONTROLLER", help="config/controller/NAME.yaml or a file: law and first gains"
    )
    p.add_argument("--out", type=Path, required=True, metavar="FILE", help="the new configuration, .yaml")
    p.add_argument("--settings", default="default", metavar="NAME", help="config/tune/NAME.yaml or a file")
    p.add_argument("--loads", type=float, nargs="+", metavar="KG", help="specimens")
    p.add_argument("--references", nargs="+", metavar="NAME", help="config/reference/NAME.yaml or files")
    p.add_argument("--observer", metavar="NAME", help="config/observer/NAME.yaml or a file")
    p.add_argument(
        "--model", choices=MODELS, help="feedforward of a virtual table: none, of each load, of a fixed load"
    )
    p.add_argument(
        "--perturbed", type=int, metavar="N", help="tables around the middle load, the worst of which counts"
    )
    p.add_argument("--evaluations", type=int, metavar="N", help="sets of gains that are tried, at most")
    p.add_argument("--force", action="store_true", help="overwrite FILE")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    options = vars(parser().parse_args(list(arguments)))
    out, force = options.pop("out"), options.pop("force")
    check_target(out, force)
    found = tune(**options)
    found.write(out, f"./shake tune {shlex.join(arguments)}", force)
    print(found)
    print(f"written: {out}")
    return 0
