"""tune: gains as a new configuration: of one controller, which minimise (6.42) over loads and perturbed tables; or with
--table observer and controller for a table that was found, several laws side by side, sound on its neighbours."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shake_ros.api.loops import MODELS
from shake_ros.api.tune import check_target, tune
from shake_ros.api.tune_table import FILES, tune_table
from shake_ros.core.loop.linear_loop import LAWS
from shake_ros.core.quantities import ShakeError
from shake_ros.data.results import refuse_existing


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="tune", description=__doc__)
    p.add_argument(
        "controller",
        nargs="?",
        metavar="CONTROLLER",
        help="config/controller/NAME.yaml or a file: law and first gains",
    )
    p.add_argument(
        "--table", metavar="TABLE", help="config/table/NAME.yaml or a file, with uncertainty.json beside it if known"
    )
    p.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="PATH",
        help="the new configuration, .yaml; with --table the folder for controller.yaml, observer.yaml and tune.json",
    )
    p.add_argument(
        "--settings", default="default", metavar="NAME", help="config/tune/NAME.yaml (config/robust_tuning) or a file"
    )
    p.add_argument("--laws", nargs="+", metavar="LAW", help=f"with --table: those tried, of {', '.join(LAWS)}")
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
    p.add_argument("--force", action="store_true", help="overwrite PATH; with --table, write gains that ring as well")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    options = vars(parser().parse_args(list(arguments)))
    out, force = options.pop("out"), options.pop("force")
    table, laws = options.pop("table"), options.pop("laws")
    if (table is None) == (options["controller"] is None):
        raise ShakeError("tune: give either a CONTROLLER or --table TABLE")
    if table is not None:
        return for_table(table, laws, options, out, force)
    if laws:
        raise ShakeError("--laws: only with --table")
    check_target(out, force)
    found = tune(**options)
    found.write(out, f"./shake tune {shlex.join(arguments)}", force)
    print(found)
    print(f"written: {out}")
    return 0


def for_table(table: str, laws: Sequence[str] | None, options: dict[str, Any], out: Path, force: bool) -> int:
    """Observer and controller for a table."""
    settings = options.pop("settings")
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise ShakeError(f"--{given[0]}: not with --table, see config/robust_tuning")
    refuse_existing(*(out / name for name in FILES), force=force)
    found = tune_table(table, settings, laws=tuple(laws or LAWS))
    print(found)
    found.write(out, force)
    print(f"written: {', '.join(str(out / name) for name in FILES)}")
    return 0
