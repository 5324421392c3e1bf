"""What `identify` and `close_loop` share: their arguments, and the model and recordings that these name."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.fitted import check_apart
from shake_ros.api.model import Model, model
from shake_ros.api.read import Recordings, read
from shake_ros.cli.reporting import add_take, taken
from shake_ros.core.identification.models import MODELS
from shake_ros.core.identification.unknown_model import NAME as UNKNOWN
from shake_ros.core.quantities import ShakeError
from shake_ros.data.results import check_folder
from shake_ros.declared import DEFAULT_TABLE


def add_data(command: argparse.ArgumentParser, needed: Sequence[str] = ()) -> None:
    """The recordings, of which some are needed ("estimation", "validation"), and the result folder."""
    for name, short, text in (
        ("estimation", "learn", "recordings to fit"),
        ("validation", "hold", "recordings that are not fitted: validation data"),
    ):
        options = (f"--{short}", f"--{name}")
        command.add_argument(
            *options, dest=name, type=Path, nargs="+", required=name in needed, default=[], metavar="BAG", help=text
        )
    add_take(command)
    command.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the results")
    command.add_argument("--force", action="store_true", help="replace an existing result folder")


def add_arguments(command: argparse.ArgumentParser, *, validation_needed: bool) -> None:
    """Arguments of both commands."""
    add_data(command, ("estimation", "validation") if validation_needed else ("estimation",))
    command.add_argument(
        "--model", choices=sorted([*MODELS, UNKNOWN]), default="full", help="declared model (default: full)"
    )
    command.add_argument(
        "--config",
        metavar="FILE",
        help="declared table: a name of config/table or a YAML file "
        f"(default: {DEFAULT_TABLE}; `unknown`: no data sheet; models other than full start from the recordings)",
    )
    command.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="change a declared value"
    )


def inputs(given: argparse.Namespace) -> tuple[Model, Recordings, Recordings]:
    """Model, estimation and validation data of the arguments; what they bring to tell goes to standard error."""
    check_folder(given.out, given.force)
    declared = model(given.model, given.config, dict(map(change, given.set)))
    estimation, validation = read_data(given)
    check_apart(estimation, validation)
    if declared.declared.driven_by == "valve_command":
        for line in [*(estimation + validation).doubts, *declared.contradictions(estimation)]:
            print(line, file=sys.stderr)
    for note in declared.notes:
        print(note, file=sys.stderr)
    return declared, estimation, validation


def read_data(given: argparse.Namespace) -> tuple[Recordings, Recordings]:
    """Estimation and validation data of the arguments; what reading met goes to standard error."""
    return read_set(given, given.estimation), read_set(given, given.validation)


def read_set(given: argparse.Namespace, bags: Sequence[Path]) -> Recordings:
    """Recordings of one set; what reading met goes to standard error."""
    found = read(*bags, take=taken(given))
    for finding in found.findings:
        print(finding, file=sys.stderr)
    return found


def change(text: str) -> tuple[str, float]:
    """Name and value of `KEY=VALUE`."""
    key, _, value = text.partition("=")
    try:
        return key, float(value)
    except ValueError:
        raise ShakeError(f"--set {text}: expected KEY=NUMBER") from None
