"""The declared models that `identify` and `close_loop` fit: what drives them, how they are declared, their effects."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass
from typing import Any

from shake_ros.core.discovery.candidates import Candidate, candidates
from shake_ros.core.identification.axis_model import AXIS, InverseDynamics
from shake_ros.core.identification.free_parameters import Declared, FreeParameter, free_parameter
from shake_ros.core.identification.recordings import FULL, Model, Record
from shake_ros.core.identification.reduced_model import REDUCED, first_table
from shake_ros.core.plant import parameters
from shake_ros.core.plant.axis import AXIS_LAYOUT
from shake_ros.core.plant.reduced_table import REDUCED_LAYOUT
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.settings import find, load_table, read_yaml

DEFAULT_TABLE = "bergamo"


@dataclass(frozen=True)
class DeclaredModel:
    """One model of the option --model.

    Attributes
    ----------
    model : simulates it. fields : its numbers by dotted name. effects : file of config/discovery with its candidates.
    driven_by : signal of a recording that drives it. declare : table from --config and the recordings to learn from.
    """

    name: str
    model: Model
    fields: Mapping[str, Field[Any]]
    effects: str
    driven_by: str
    declare: Callable[[str | None, list[Record]], Declared]

    def table(self, config: str | None, changes: Sequence[str], learn: list[Record]) -> Declared:
        """The declared table with `key=value` changes."""
        values = self.changed(changes)
        return self.declare(config, learn).with_values(values)

    def changed(self, changes: Sequence[str]) -> dict[str, float]:
        """Values by dotted name of `key=value` texts; a key may be the last part of a name alone."""
        values = {}
        for change in changes:
            key, equals, text = change.partition("=")
            name = self.full_name(key)
            try:
                values[name] = float(text)
            except ValueError:
                raise ShakeError(f"--set {change}: expected KEY=NUMBER") from None
            if not equals:
                raise ShakeError(f"--set {change}: expected KEY=NUMBER")
        return values

    def full_name(self, key: str) -> str:
        """The dotted name of a parameter given by it or by its last part alone (`specimen_mass`)."""
        if key in self.fields:
            return key
        matches = [name for name in self.fields if name.rpartition(".")[2] == key]
        if len(matches) == 1:
            return matches[0]
        if matches:
            raise ShakeError(f"--set {key}: could be {', '.join(matches)}")
        raise unknown_name("parameter", key, self.fields, "--set")

    def free(self) -> list[FreeParameter]:
        """The parameters that a fit may move, from config/identification."""
        return self._parameters(late=False)

    def late(self) -> list[FreeParameter]:
        """Those that it may move only once they explain much of what is left."""
        return self._parameters(late=True)

    def _parameters(self, late: bool) -> list[FreeParameter]:
        path = find("identification", self.name)
        entries = {n: dict(c) for n, c in read_yaml(path).items()}
        return [
            free_parameter(n, c, str(path), self.fields) for n, c in entries.items() if c.pop("late", False) is late
        ]

    def candidates(self) -> tuple[Candidate, ...]:
        """Every effect with its trials, from config/discovery."""
        path = find("discovery", self.effects)
        return candidates(read_yaml(path), str(path), self.name, self.fields)


def declare_full(config: str | None, learn: list[Record]) -> Declared:
    """The table of a configuration."""
    return load_table(config or DEFAULT_TABLE)


def declare_reduced(config: str | None, learn: list[Record]) -> Declared:
    """The reduced table of a configuration; a first guess from the recordings where it declares no β."""
    if config is None:
        return first_table(learn)
    path = find("table", config)
    content = read_yaml(path)
    if isinstance(content, Mapping) and "dynamics" in content:
        return REDUCED_LAYOUT.table(content, str(path))
    known = (*parameters.SECTIONS, "effects")
    if not isinstance(content, Mapping) or any(key not in known for key in content):
        raise ShakeError(f"{path}: expected a reduced table with the section 'dynamics', or the sections of a table")
    print(f"{path}: declares no beta1 … beta5; the reduced model starts from the recordings alone", file=sys.stderr)
    return first_table(learn)


def declare_axis(config: str | None, learn: list[Record]) -> Declared:
    """The axis of a YAML file with the section `axis`; without one, by inverse dynamics."""
    if config is None:
        return InverseDynamics(learn).solve()
    path = find("table", config)
    return AXIS_LAYOUT.table(read_yaml(path), str(path))


MODELS: dict[str, DeclaredModel] = {
    "full": DeclaredModel("full", FULL, parameters.FIELDS, "effects", "valve_command", declare_full),
    "reduced": DeclaredModel(
        "reduced", REDUCED, REDUCED_LAYOUT.fields, "reduced_effects", "valve_command", declare_reduced
    ),
    "axis": DeclaredModel("axis", AXIS, AXIS_LAYOUT.fields, "axis_effects", "force", declare_axis),
}
