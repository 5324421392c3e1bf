"""The declared models that a fit starts from: what drives them, how they are declared, what a fit may move or add."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass
from typing import Any

from shake_ros.core.discovery.candidates import CandidateEffect, candidates
from shake_ros.core.discovery.problem import ModelStructure
from shake_ros.core.identification import experiments
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
    """One kind of declared model.

    Attributes
    ----------
    model : simulates it. fields : its numbers by dotted name. effects : file of config/discovery with its candidates.
    driven_by : signal of a recording that drives it. declare : table of a configuration; None where that declares no
    numbers of this model. guess : the table to start from where none is declared, from recordings.
    """

    name: str
    model: Model
    fields: Mapping[str, Field[Any]]
    effects: str
    driven_by: str
    declare: Callable[[str | None], Declared | None]
    guess: Callable[[list[Record]], Declared]

    def structure(self, table: Declared) -> ModelStructure:
        """A table of this model with what a fit may move and the effects that it may lack."""
        return ModelStructure(table, tuple(self.free()), tuple(self.late()), self.candidates(), self.model)

    def full_name(self, key: str) -> str:
        """The dotted name of a parameter given by it or by its last part alone (`specimen_mass`)."""
        if key in self.fields:
            return key
        matches = [name for name in self.fields if name.rpartition(".")[2] == key]
        if len(matches) == 1:
            return matches[0]
        if matches:
            raise ShakeError(f"set: {key}: could be {', '.join(matches)}")
        raise unknown_name("parameter", key, self.fields, "set")

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

    def candidates(self) -> tuple[CandidateEffect, ...]:
        """Every effect with its trials, from config/discovery."""
        path = find("discovery", self.effects)
        return candidates(read_yaml(path), str(path), self.name, self.fields)


def recordings_to_make() -> tuple[experiments.Candidate, ...]:
    """The catalogue of recordings of which the most helpful is named, from config/experiment."""
    path = find("experiment", "catalogue")
    return experiments.catalogue(read_yaml(path), str(path))


def declare_full(config: str | None) -> Declared:
    """The table of a configuration."""
    return load_table(config or DEFAULT_TABLE)


def guess_full(records: list[Record]) -> Declared:
    """The default table, whatever was recorded."""
    return load_table(DEFAULT_TABLE)


def declare_reduced(config: str | None) -> Declared | None:
    """The reduced table of a configuration; None where it declares no β, or there is none."""
    if config is None:
        return None
    path = find("table", config)
    content = read_yaml(path)
    if isinstance(content, Mapping) and "dynamics" in content:
        return REDUCED_LAYOUT.table(content, str(path))
    known = (*parameters.SECTIONS, "effects")
    if not isinstance(content, Mapping) or any(key not in known for key in content):
        raise ShakeError(f"{path}: expected a reduced table with the section 'dynamics', or the sections of a table")
    return None


def declare_axis(config: str | None) -> Declared | None:
    """The axis of a YAML file with the section `axis`."""
    if config is None:
        return None
    path = find("table", config)
    return AXIS_LAYOUT.table(read_yaml(path), str(path))


def guess_axis(records: list[Record]) -> Declared:
    """The axis of inverse dynamics."""
    return InverseDynamics(records).solve()


MODELS: dict[str, DeclaredModel] = {
    "full": DeclaredModel("full", FULL, parameters.FIELDS, "effects", "valve_command", declare_full, guess_full),
    "reduced": DeclaredModel(
        "reduced", REDUCED, REDUCED_LAYOUT.fields, "reduced_effects", "valve_command", declare_reduced, first_table
    ),
    "axis": DeclaredModel("axis", AXIS, AXIS_LAYOUT.fields, "axis_effects", "force", declare_axis, guess_axis),
}
