"""Tables of few parameters: one section of numbers and the effects that make sense with it.

The reduced table (6.36) and the force-driven axis are such tables. Their numbers have dotted names as in
plant/parameters.py (`dynamics.beta1`, `effects.spool_deadband.width`), and the flat record that compiled code reads has
the same names with underscores for dots.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.core.effects import EFFECTS, Effect
from shake_ros.core.quantities import Parameters, ShakeError, unknown_name

PER_MASS = {  # unit of a force in an effect → unit per moved mass
    "N": "m/s^2",
    "N/m": "1/s^2",
    "N/m^2": "1/(m*s^2)",
    "N*s^2/m^2": "1/m",
    "kg": "-",
}


def per_mass(field: dataclasses.Field[Any]) -> dataclasses.Field[Any]:
    """The field of a force per moved mass; others unchanged."""
    unit = field.metadata["unit"]
    if unit not in PER_MASS:
        return field
    meaning = f"{field.metadata['meaning']}, per moved mass"
    made: dataclasses.Field[Any] = dataclasses.field(
        default=field.default, metadata={**field.metadata, "unit": PER_MASS[unit], "meaning": meaning}
    )
    made.name, made.type = field.name, field.type
    return made


class Layout:
    """What a kind of small table holds.

    model : name of the declared model, as effects name it. section, parameters : its section and that one's class.
    forces_per_mass : whether the effects' forces count per moved mass. without : dotted names that mean nothing here.
    """

    def __init__(
        self,
        model: str,
        section: str,
        parameters: type[Parameters],
        *,
        forces_per_mass: bool,
        without: tuple[str, ...] = (),
    ) -> None:
        self.model, self.section, self.parameters = model, section, parameters
        self.effects = tuple(name for name, effect in EFFECTS.items() if model in effect.models)
        fields = {f"{section}.{f.name}": f for f in dataclasses.fields(parameters)}
        for effect in self.effects:
            for field in dataclasses.fields(EFFECTS[effect]):
                fields[f"effects.{effect}.{field.name}"] = per_mass(field) if forces_per_mass else field
        self.fields: dict[str, dataclasses.Field[Any]] = {n: f for n, f in fields.items() if n not in without}
        self.names = tuple(self.fields)
        self.record = np.dtype([(name.removeprefix("effects.").replace(".", "_"), "f8") for name in self.names])

    def records(self, vectors: np.ndarray) -> np.recarray[Any, Any]:
        """Parameter vectors of shape (n, len(names)) as n records for compiled code."""
        rows = np.ascontiguousarray(np.atleast_2d(vectors), dtype=np.float64)
        return rows.view(self.record).reshape(len(rows)).view(np.recarray)

    def table(self, mapping: Mapping[str, Any], where: str) -> SmallTable:
        """Build from the content of a YAML file with this section and, if wanted, `effects`."""
        if not isinstance(mapping, Mapping) or self.section not in mapping:
            raise ShakeError(f"{where}: missing section '{self.section}'")
        for key in mapping:
            if key not in (self.section, "effects"):
                raise unknown_name("section", key, (self.section, "effects"), where)
        given = mapping.get("effects") or {}
        if not isinstance(given, Mapping):
            raise ShakeError(f"{where}: effects: expected a mapping of effect names")
        effects = {}
        for name, content in given.items():
            if name not in self.effects:
                raise unknown_name(f"effect of the model {self.model}", name, self.effects, where)
            effects[name] = EFFECTS[name].from_mapping(content or {}, f"{where}: effects.{name}")
        return SmallTable(
            self, self.parameters.from_mapping(mapping[self.section], f"{where}: {self.section}"), effects
        )


@dataclass(frozen=True)
class SmallTable:
    """A table of few parameters. `effects` holds the effects beyond them by name; an absent one is not in it."""

    layout: Layout
    parameters: Parameters
    effects: Mapping[str, Effect] = dataclasses.field(default_factory=dict)

    def to_mapping(self) -> dict[str, Any]:
        """The content of a YAML file."""
        tree: dict[str, Any] = {self.layout.section: dataclasses.asdict(self.parameters)}
        if self.effects:
            tree["effects"] = {name: dataclasses.asdict(effect) for name, effect in self.effects.items()}
        return tree

    @property
    def fields(self) -> Mapping[str, dataclasses.Field[Any]]:
        """Fields of all numbers by dotted name, in the order of `vector`."""
        return self.layout.fields

    def value(self, name: str) -> float:
        """Value of a dotted name; an absent effect's fields have their neutral values."""
        if name not in self.fields:
            raise unknown_name("parameter", name, self.fields)
        section, _, rest = name.partition(".")
        if section == self.layout.section:
            return float(getattr(self.parameters, rest))
        effect, _, field = rest.partition(".")
        return float(getattr(self.effects[effect] if effect in self.effects else EFFECTS[effect](), field))

    def with_values(self, values: Mapping[str, float]) -> SmallTable:
        """A copy with some dotted names changed, checked against their bounds; adds the effects they belong to."""
        parameters, effects = self.parameters, dict(self.effects)
        for name, value in values.items():
            if name not in self.fields:
                raise unknown_name("parameter", name, self.fields)
            section, _, rest = name.partition(".")
            if section == self.layout.section:
                parameters = parameters.replace(**{rest: value})
            else:
                effect, _, field = rest.partition(".")
                effects[effect] = (effects.get(effect) or EFFECTS[effect]()).replace(**{field: value})
        return SmallTable(self.layout, parameters, effects)

    def vector(self) -> np.ndarray:
        """All numbers in the order of the layout's names, shape (len(names),)."""
        return np.array([self.value(name) for name in self.fields])
