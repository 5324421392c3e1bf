"""Commands on controllers, and on studies of many runs: tune, compare, campaign."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shake_ros.api.compare import compare
from shake_ros.api.loops import MODELS
from shake_ros.api.tune import check_target, tune
from shake_ros.api.tune_table import FILES, tune_table
from shake_ros.campaigns.campaign import campaign
from shake_ros.cli.arguments import CommandLine, reported, reporting
from shake_ros.control.linear_loop import LAWS
from shake_ros.quantities import ShakeError
from shake_ros.result_folder import refuse_existing
from shake_ros.settings import value_of

TUNE_METHOD = """\
The gains of one CONTROLLER minimise (6.42) over loads and perturbed tables. With --table observer and controller are
made for a table that was found: several laws side by side, sound on its neighbours."""


def tune_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("tune", TUNE_METHOD)
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
    p.add_argument("--laws", nargs="+", metavar="LAW", help=f"with --table: laws to try, of {', '.join(LAWS)}")
    p.add_argument("--loads", type=float, nargs="+", metavar="KG", help="masses of the specimen")
    p.add_argument("--references", nargs="+", metavar="NAME", help="config/reference/NAME.yaml or files")
    p.add_argument("--observer", metavar="NAME", help="config/observer/NAME.yaml or a file")
    p.add_argument(
        "--model", choices=MODELS, help="feedforward of a virtual table: none, of each load, of a fixed load"
    )
    p.add_argument(
        "--perturbed", type=int, metavar="N", help="perturbed tables around the middle load; the worst one counts"
    )
    p.add_argument("--evaluations", type=int, metavar="N", help="sets of gains that are tried, at most")
    p.add_argument("--force", action="store_true", help="overwrite PATH; with --table, also write gains that oscillate")
    given = p.read(arguments)
    changes = ("loads", "references", "observer", "model", "perturbed", "evaluations")
    options = {name: getattr(given, name) for name in changes if getattr(given, name) is not None}
    if (given.table is None) == (given.controller is None):
        raise ShakeError("tune: give either a CONTROLLER or --table TABLE")
    if given.table is not None:
        for name in options:
            raise ShakeError(f"--{name}: not with --table, see config/robust_tuning")
        return for_table(given)
    if given.laws:
        raise ShakeError("--laws: only with --table")
    check_target(given.out, given.force)
    found = tune(given.controller, given.settings, **options)
    found.write(given.out, given.line, given.force)
    print(found)
    print(f"written: {given.out}")
    return 0


def for_table(given: argparse.Namespace) -> int:
    """Observer and controller for a table."""
    targets = [given.out / name for name in FILES]
    refuse_existing(*targets, force=given.force)
    found = tune_table(given.table, given.settings, laws=tuple(given.laws or LAWS))
    print(found)
    found.write(given.out, given.force)
    print(f"written: {', '.join(map(str, targets))}")
    return 0


def compare_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("compare")
    p.add_folder("result folder")
    p.add_verb(compare, "changes", records="record")
    p.add_figures()
    given = p.read(arguments)
    refuse_existing(given.out, force=given.force)
    began, spent = time.monotonic(), time.process_time()
    found = compare(**p.options(given))
    wall, processor = time.monotonic() - began, time.process_time() - spent
    print(f"{len(found.outcomes)} loops in {wall:.0f} s, {processor:.0f} s of processor time")
    return reported(found, given)


CAMPAIGN_METHOD = """\
A study of many independent fits or loops: on this machine's cores or on a cluster, each row once, in one file that an
interrupted study goes on with; tables and figures of what was found."""


def campaign_command(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    p = CommandLine("campaign", CAMPAIGN_METHOD)
    p.add_argument("study", metavar="STUDY", help="config/studies/STUDY.yaml or a file")
    p.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder of the rows; an existing one is continued"
    )
    p.add_set("values of the study to replace, in YAML", "NAME=VALUE")
    p.add_verb(campaign, "changes")
    p.add_argument("--compare", type=Path, metavar="OTHER", help="folder of an older campaign of the same study")
    p.add_figures()
    given = p.read(arguments)
    if given.minutes is not None and not 0.0 <= given.minutes < float("inf"):
        raise ShakeError(f"--minutes {given.minutes:g}: must be 0 or more")
    try:
        found = campaign(given.study, given.out, changes=changes_of(given.set or ()), **p.options(given))
    except KeyboardInterrupt:
        print(f"stopped; finished rows are in {given.out}, and the same command continues", file=sys.stderr)
        raise
    page = found.report(given.compare, **reporting(given))
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
