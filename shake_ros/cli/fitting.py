"""What `identify` and `close_loop` share: arguments, the declared table with its changes, recordings, parameters."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from shake_ros.core.discovery.candidates import Candidate, candidates
from shake_ros.core.identification.free_parameters import FreeParameter, free_parameter
from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.parameters import FIELDS, NAMES, TableParameters
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.fit_records import read_fit_records
from shake_ros.settings import find, load_table, read_yaml

MODELS = ("full",)


def add_arguments(command: argparse.ArgumentParser, hold_needed: bool) -> None:
    """Arguments of both commands."""
    command.add_argument("--learn", type=Path, nargs="+", required=True, metavar="BAG", help="recordings to fit")
    command.add_argument(
        "--hold", type=Path, nargs="+", required=hold_needed, default=[], metavar="BAG", help="recordings held out"
    )
    command.add_argument("--model", choices=MODELS, default="full", help="declared model (default: full)")
    command.add_argument(
        "--config",
        default="bergamo",
        metavar="FILE",
        help="declared table: a name of config/table or a YAML file (default: bergamo)",
    )
    command.add_argument(
        "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="change a declared value"
    )
    command.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the results")
    command.add_argument("--force", action="store_true", help="replace an existing result folder")


def full_name(key: str) -> str:
    """The dotted name of a parameter given by it or by its last part alone (`specimen_mass`)."""
    if key in FIELDS:
        return key
    matches = [name for name in NAMES if name.rpartition(".")[2] == key]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise ShakeError(f"--set {key}: could be {', '.join(matches)}")
    raise unknown_name("parameter", key, NAMES, "--set")


def declared_table(config: str, changes: Sequence[str]) -> TableParameters:
    """The declared table with `key=value` changes."""
    values = {}
    for change in changes:
        key, equals, text = change.partition("=")
        try:
            values[full_name(key)] = float(text)
        except ShakeError:
            raise
        except ValueError:
            raise ShakeError(f"--set {change}: expected KEY=NUMBER") from None
        if not equals:
            raise ShakeError(f"--set {change}: expected KEY=NUMBER")
    return load_table(config).with_values(values)


def declared_parameters(model: str) -> list[FreeParameter]:
    """The parameters of a declared model that a fit may move, from config/identification."""
    path = find("identification", model)
    return [free_parameter(name, content, str(path)) for name, content in read_yaml(path).items()]


def all_candidates(model: str) -> tuple[Candidate, ...]:
    """Every effect with its trials, from config/discovery."""
    path = find("discovery", "effects")
    return candidates(read_yaml(path), str(path), model)


def check_output(out: Path, force: bool) -> None:
    """Refuse an existing result folder before the work, not after it."""
    if out.exists() and not force:
        raise ShakeError(f"{out}: exists already (--force replaces it)")


def read_records(learn: Sequence[Path], hold: Sequence[Path]) -> tuple[list[Record], list[Record]]:
    """Records of both sets; what reading them met goes to standard error. A recording in both sets is an error."""
    first, findings = read_fit_records(learn)
    second, more = read_fit_records(hold)
    for finding in findings + more:
        print(finding, file=sys.stderr)
    both = {r.name for r in first} & {r.name for r in second}
    if both:
        raise ShakeError(f"{', '.join(sorted(both))}: given both to learn from and to hold out")
    return first, second
