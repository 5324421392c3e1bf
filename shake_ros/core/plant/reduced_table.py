"""Parameters of a table whose hydraulics are not declared: β_1 … β_5 of (6.36) with effects, forces per moved mass.

Nothing tells mass, areas or pressures apart there, so every force of an effect counts per moved mass: newton becomes
m/s². The numbers have dotted names as in plant/parameters.py (`dynamics.beta1`, `effects.spool_deadband.width`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.core.effects import EFFECTS, Effect
from shake_ros.core.plant.reduced import ReducedParameters
from shake_ros.core.quantities import ShakeError, unknown_name

PER_MASS = {  # unit of a field of an effect → unit per moved mass
    "N": "m/s^2",
    "N/m": "1/s^2",
    "N/m^2": "1/(m*s^2)",
    "N*s^2/m^2": "1/m",
    "kg": "-",
}
ONLY_FULL = ("effects.slow_valve.slowdown",)  # relative to a valve that is declared


def parameter_names() -> Iterator[tuple[str, dataclasses.Field[Any]]]:
    """Dotted names of all numbers in the order of the record, with their fields in units per moved mass."""
    for field in dataclasses.fields(ReducedParameters):
        yield f"dynamics.{field.name}", field
    for effect, cls in EFFECTS.items():
        if "reduced" not in cls.models:
            continue
        for field in dataclasses.fields(cls):
            name = f"effects.{effect}.{field.name}"
            if name not in ONLY_FULL:
                yield name, _per_mass(field)


def _per_mass(field: dataclasses.Field[Any]) -> dataclasses.Field[Any]:
    unit = field.metadata["unit"]
    if unit not in PER_MASS:
        return field
    meaning = f"{field.metadata['meaning']}, per moved mass"
    metadata = {**field.metadata, "unit": PER_MASS[unit], "meaning": meaning}
    made: dataclasses.Field[Any] = dataclasses.field(default=field.default, metadata=metadata)
    made.name, made.type = field.name, field.type
    return made


FIELDS: dict[str, dataclasses.Field[Any]] = dict(parameter_names())
NAMES: tuple[str, ...] = tuple(FIELDS)
INDEX: dict[str, int] = {name: i for i, name in enumerate(NAMES)}
RECORD = np.dtype([(name.removeprefix("effects.").replace(".", "_"), "f8") for name in NAMES])


@dataclass(frozen=True)
class ReducedTable:
    """A table in the form (6.36). `effects` holds the effects beyond it by name; an absent one is not in it."""

    dynamics: ReducedParameters
    effects: Mapping[str, Effect] = dataclasses.field(default_factory=dict)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], where: str) -> ReducedTable:
        """Build from the content of a YAML file with the sections `dynamics` and, if wanted, `effects`."""
        if not isinstance(mapping, Mapping) or "dynamics" not in mapping:
            raise ShakeError(f"{where}: a reduced table needs the section 'dynamics' (beta1 … beta5)")
        for key in mapping:
            if key not in ("dynamics", "effects"):
                raise unknown_name("section", key, ("dynamics", "effects"), where)
        given = mapping.get("effects") or {}
        if not isinstance(given, Mapping):
            raise ShakeError(f"{where}: effects: expected a mapping of effect names")
        known = [name for name, effect in EFFECTS.items() if "reduced" in effect.models]
        effects = {}
        for name, content in given.items():
            if name not in known:
                raise unknown_name("effect of the reduced model", name, known, where)
            effects[name] = EFFECTS[name].from_mapping(content or {}, f"{where}: effects.{name}")
        return cls(ReducedParameters.from_mapping(mapping["dynamics"], f"{where}: dynamics"), effects)

    def to_mapping(self) -> dict[str, Any]:
        """The content of a YAML file."""
        tree: dict[str, Any] = {"dynamics": dataclasses.asdict(self.dynamics)}
        if self.effects:
            tree["effects"] = {name: dataclasses.asdict(effect) for name, effect in self.effects.items()}
        return tree

    @property
    def fields(self) -> Mapping[str, dataclasses.Field[Any]]:
        """Fields of all numbers by dotted name, in the order of `vector`."""
        return FIELDS

    def value(self, name: str) -> float:
        """Value of a dotted name; an absent effect's fields have their neutral values."""
        if name not in FIELDS:
            raise unknown_name("parameter", name, NAMES)
        section, _, rest = name.partition(".")
        if section == "dynamics":
            return float(getattr(self.dynamics, rest))
        effect, _, field = rest.partition(".")
        return float(getattr(self.effects[effect] if effect in self.effects else EFFECTS[effect](), field))

    def with_values(self, values: Mapping[str, float]) -> ReducedTable:
        """A copy with some dotted names changed, checked against their bounds; adds the effects they belong to."""
        dynamics, effects = self.dynamics, dict(self.effects)
        for name, value in values.items():
            if name not in FIELDS:
                raise unknown_name("parameter", name, NAMES)
            section, _, rest = name.partition(".")
            if section == "dynamics":
                dynamics = dynamics.replace(**{rest: value})
            else:
                effect, _, field = rest.partition(".")
                effects[effect] = (effects.get(effect) or EFFECTS[effect]()).replace(**{field: value})
        return ReducedTable(dynamics, effects)

    def vector(self) -> np.ndarray:
        """All numbers in the order of `NAMES`, shape (len(NAMES),)."""
        return np.array([self.value(name) for name in NAMES])


def records(vectors: np.ndarray) -> np.recarray[Any, Any]:
    """Parameter vectors of shape (n, len(NAMES)) as n records for compiled code."""
    rows = np.ascontiguousarray(np.atleast_2d(vectors), dtype=np.float64)
    return rows.view(RECORD).reshape(len(rows)).view(np.recarray)
