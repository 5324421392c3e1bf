"""What `identify` and `close_loop` share: arguments, recordings, the declared model's parameters and candidates."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.model import Model, model
from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.identification.free_parameters import FreeParameter
from shake_ros.core.identification.recordings import Record
from shake_ros.core.quantities import ShakeError
from shake_ros.data.fit_records import read_fit_records
from shake_ros.declared import DEFAULT_TABLE, MODELS


def add_arguments(command: argparse.ArgumentParser, hold_needed: bool) -> None:
    """Arguments of both commands."""
    command.add_argument("--learn", type=Path, nargs="+", required=True, metavar="BAG", help="recordings to fit")
    command.add_argument(
        "--hold", type=Path, nargs="+", required=hold_needed, default=[], metavar="BAG", help="recordings held out"
    )
    command.add_argument("--model", choices=sorted(MODELS), default="full", help="declared model (default: full)")
    command.add_argument(
        "--config",
        metavar="FILE",
        help="declared table: a name of config/table or a YAML file "
        f"(default: {DEFAULT_TABLE}; models other than full start from the recordings)",
    )
    command.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="change a declared value"
    )
    command.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the results")
    command.add_argument("--force", action="store_true", help="replace an existing result folder")


def declared_parameters(model: str) -> list[FreeParameter]:
    """The parameters of a declared model that a fit may move, from config/identification."""
    return MODELS[model].free()


def late_parameters(model: str) -> list[FreeParameter]:
    """Those that it may move only once they explain much of what is left above the noise."""
    return MODELS[model].late()


def all_candidates(model: str) -> tuple[Candidate, ...]:
    """Every effect with its trials, from config/discovery."""
    return MODELS[model].candidates()


def declare(given: argparse.Namespace) -> Model:
    """The declared model of the arguments; what its table does not declare goes to standard error."""
    changes = {}
    for change in given.set:
        key, equals, text = change.partition("=")
        try:
            changes[key] = float(text)
        except ValueError:
            raise ShakeError(f"--set {change}: expected KEY=NUMBER") from None
        if not equals:
            raise ShakeError(f"--set {change}: expected KEY=NUMBER")
    declared = model(given.model, given.config, changes)
    for note in declared.notes:
        print(note, file=sys.stderr)
    return declared


def check_output(out: Path, force: bool) -> None:
    """Refuse an existing result folder before the work, not after it."""
    if out.exists() and not force:
        raise ShakeError(f"{out}: exists already (--force replaces it)")
    above = next((folder for folder in out.absolute().parents if folder.exists()), None)
    if above is None or not above.is_dir() or not os.access(above, os.W_OK):
        raise ShakeError(f"{out}: cannot be made (no permission to write in {above})")


def read_records(
    learn: Sequence[Path], hold: Sequence[Path], driven_by: str = "valve_command"
) -> tuple[list[Record], list[Record]]:
    """Records of both sets; what reading them met goes to standard error. A recording in both sets is an error."""
    first, findings = read_fit_records(learn, driven_by)
    second, more = read_fit_records(hold, driven_by)
    for finding in findings + more:
        print(finding, file=sys.stderr)
    both = {r.name for r in first} & {r.name for r in second}
    if both:
        raise ShakeError(f"{', '.join(sorted(both))}: given both to learn from and to hold out")
    return first, second
