"""Parameters of a table: sections as frozen dataclasses, and the flat record that compiled code reads.

A table is a tree of sections (`table`, `supply`, `valve`, `bulk_modulus`, `friction`, `leakage`, `sensors`,
`effects`). Its dotted names (`valve.flow_coefficient`, `effects.soft_zone.depth`) are the names of a YAML file, of
ROS parameters, of a fit and of a report; the record's fields are the same names with underscores for dots.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.core.bulk_modulus import BULK_MODULI, BulkModulusLaw
from shake_ros.core.effects import EFFECTS, Effect
from shake_ros.core.friction import FRICTIONS, FrictionLaw
from shake_ros.core.packing import field_value, name_of, union_fields
from shake_ros.core.plant.cavitation import Cavitation
from shake_ros.core.plant.pipelines import Pipelines
from shake_ros.core.plant.shear_frame import ShearFrame
from shake_ros.core.quantities import Parameters, ShakeError, quantity, unknown_name
from shake_ros.core.valve import VALVES


@dataclass(frozen=True)
class Body(Parameters):
    """Cylinder, table and specimen, (6.4), (6.9), (6.11)."""

    piston_area: float = quantity("m^2", "annular piston area A_p", low=1e-6, high=1.0)
    cylinder_volume: float = quantity("m^3", "total oil volume of both chambers V_t", low=1e-8, high=1.0)
    table_mass: float = quantity("kg", "mass of table, rod and piston M_b", low=1.0, high=1e6)
    specimen_mass: float = quantity("kg", "mass of the specimen M_l", low=0.0, high=1e6, live=True)
    stroke: float = quantity("m", "full stroke between the end stops", low=1e-3, high=10.0)
    end_stop_stiffness: float = quantity("N/m", "stiffness of an end stop", low=1e4, high=1e10)
    end_stop_damping: float = quantity("N*s/m", "damping of an end stop", low=0.0, high=1e8)


@dataclass(frozen=True)
class Supply(Parameters):
    """Hydraulic supply."""

    supply_pressure: float = quantity("Pa", "supply pressure P_s", low=1e5, high=1e8, live=True)
    tank_pressure: float = quantity("Pa", "tank pressure P_T", low=0.0, high=1e7, live=True)


@dataclass(frozen=True)
class Leakage(Parameters):
    """Laminar leakage, (3.25)."""

    internal: float = quantity("m^3/(s*Pa)", "leakage between the chambers C_il", low=0.0, high=1e-6, live=True)
    external: float = quantity(
        "m^3/(s*Pa)", "leakage of each chamber to the outside C_el", low=0.0, high=1e-6, live=True
    )


@dataclass(frozen=True)
class SensorParameters(Parameters):
    """Noise and resolution of the sensors."""

    position_noise: float = quantity("m", "standard deviation of the position noise", low=0.0, high=0.01, live=True)
    position_range: float = quantity("m", "full measuring range of the position sensor", low=1e-3, high=10.0)
    position_bits: int = quantity("-", "bits of the position converter, 0 for no steps", low=0, high=32)
    acceleration_noise: float = quantity(
        "m/s^2", "standard deviation of the acceleration noise", low=0.0, high=10.0, live=True
    )
    pressure_noise: float = quantity("Pa", "standard deviation of the pressure noise", low=0.0, high=1e6, live=True)


SECTIONS: dict[str, type[Parameters]] = {
    "body": Body,
    "supply": Supply,
    "valve": Parameters,
    "bulk_modulus": BulkModulusLaw,
    "friction": FrictionLaw,
    "leakage": Leakage,
    "sensors": SensorParameters,
    "cavitation": Cavitation,
    "pipelines": Pipelines,
    "frame": ShearFrame,
}
FAMILIES: dict[str, Mapping[str, type[Parameters]]] = {
    "valve": VALVES,
    "bulk_modulus": BULK_MODULI,
    "friction": FRICTIONS,
}
DECLARED_KIND = {
    "valve": "simplified",
    "bulk_modulus": "constant",
    "friction": "tustin",
}  # where a file's section has no key `kind`
OPTIONAL = ("cavitation", "pipelines", "frame")  # absent by default, at no cost


def parameter_names() -> Iterator[tuple[str, dataclasses.Field[Any]]]:
    """Dotted names of all numbers of a table in the order of the record, with their fields."""
    for section, cls in SECTIONS.items():
        fields = (
            union_fields(FAMILIES[section]) if section in FAMILIES else {f.name: f for f in dataclasses.fields(cls)}
        )
        for name, field in fields.items():
            yield f"{section}.{name}", field
    for effect, effect_cls in EFFECTS.items():
        for field in dataclasses.fields(effect_cls):
            yield f"effects.{effect}.{field.name}", field


FIELDS: dict[str, dataclasses.Field[Any]] = dict(parameter_names())
NAMES: tuple[str, ...] = tuple(FIELDS)
INDEX: dict[str, int] = {name: i for i, name in enumerate(NAMES)}
RECORD = np.dtype([(name.removeprefix("effects.").replace(".", "_"), "f8") for name in NAMES])


def section_from(section: str, content: Any, where: str) -> Parameters:
    """One section of a table's file; the key `kind` of a family's section chooses the member."""
    cls = SECTIONS[section]
    if section in FAMILIES:
        kind, family = DECLARED_KIND[section], FAMILIES[section]
        if isinstance(content, Mapping) and "kind" in content:
            kind = content["kind"]
            content = {key: value for key, value in content.items() if key != "kind"}
        if not isinstance(kind, str) or kind not in family:
            raise unknown_name(f"{section} kind", kind, family, where)
        cls = family[kind]
    return cls.from_mapping(content, where)


@dataclass(frozen=True)
class TableParameters:
    """A whole table. `effects` holds the effects beyond the declared model by name; an absent one is not in it.

    `friction`, `bulk_modulus` and `valve` are any member of FRICTIONS, BULK_MODULI and VALVES; in a file the section's
    key `kind` names it, DECLARED_KIND where the key is absent. A name that only another member of the family has
    (`friction.static_level` under Tustin's law) reads as zero and cannot be set.
    """

    body: Body
    supply: Supply
    valve: Parameters
    bulk_modulus: BulkModulusLaw
    friction: FrictionLaw
    leakage: Leakage
    sensors: SensorParameters
    cavitation: Cavitation = dataclasses.field(default_factory=Cavitation)
    pipelines: Pipelines = dataclasses.field(default_factory=Pipelines)
    frame: ShearFrame = dataclasses.field(default_factory=ShearFrame)
    effects: Mapping[str, Effect] = dataclasses.field(default_factory=dict)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], where: str) -> TableParameters:
        """Build from the content of a table's YAML file; errors name the file and the section."""
        if not isinstance(mapping, Mapping):
            raise ShakeError(f"{where}: expected sections {', '.join(SECTIONS)}, got {type(mapping).__name__}")
        for key in mapping:
            if key not in SECTIONS and key != "effects":
                raise unknown_name("section", key, [*SECTIONS, "effects"], where)
        missing = [s for s in SECTIONS if s not in mapping and s not in OPTIONAL]
        if missing:
            raise ShakeError(f"{where}: missing section {', '.join(missing)}")
        sections = {s: section_from(s, mapping[s], f"{where}: {s}") for s in SECTIONS if s in mapping}
        effects = {}
        given = mapping.get("effects") or {}
        if not isinstance(given, Mapping):
            raise ShakeError(f"{where}: effects: expected a mapping of effect names")
        for name, content in given.items():
            if name not in EFFECTS:
                raise unknown_name("effect", name, EFFECTS, where)
            effects[name] = EFFECTS[name].from_mapping(content or {}, f"{where}: effects.{name}")
        return cls(**sections, effects=effects)  # type: ignore[arg-type]

    def to_mapping(self) -> dict[str, Any]:
        """The tree as plain mappings, as a YAML file holds it."""
        tree: dict[str, Any] = {s: dataclasses.asdict(getattr(self, s)) for s in SECTIONS}
        for section in OPTIONAL:
            if getattr(self, section) == SECTIONS[section]():
                del tree[section]
        for section, family in FAMILIES.items():
            kind = name_of(family, getattr(self, section))
            if kind != DECLARED_KIND[section]:
                tree[section] = {"kind": kind} | tree[section]
        if self.effects:
            tree["effects"] = {name: dataclasses.asdict(effect) for name, effect in self.effects.items()}
        return tree

    def value(self, name: str) -> float:
        """Value of a dotted name; an absent effect's fields have their neutral values."""
        if name not in FIELDS:
            raise unknown_name("parameter", name, NAMES)
        section, _, rest = name.partition(".")
        if section in FAMILIES:
            return field_value(getattr(self, section), rest)
        if section != "effects":
            return float(getattr(getattr(self, section), rest))
        effect, _, field = rest.partition(".")
        return float(getattr(self.effects[effect] if effect in self.effects else EFFECTS[effect](), field))

    def with_values(self, values: Mapping[str, float]) -> TableParameters:
        """A copy with some dotted names changed, checked against their bounds; adds the effects they belong to."""
        sections: dict[str, Any] = {s: getattr(self, s) for s in SECTIONS}
        effects = dict(self.effects)
        for name, value in values.items():
            if name not in FIELDS:
                raise unknown_name("parameter", name, NAMES)
            section, _, rest = name.partition(".")
            if section != "effects":
                sections[section] = sections[section].replace(**{rest: value})
            else:
                effect, _, field = rest.partition(".")
                effects[effect] = (effects[effect] if effect in effects else EFFECTS[effect]()).replace(
                    **{field: value}
                )
        return TableParameters(**sections, effects=effects)

    @property
    def fields(self) -> Mapping[str, dataclasses.Field[Any]]:
        """Fields of all numbers by dotted name, in the order of `vector`."""
        return FIELDS

    def vector(self) -> np.ndarray:
        """All numbers in the order of `NAMES`, shape (len(NAMES),)."""
        return self._vector.copy()

    @functools.cached_property
    def _vector(self) -> np.ndarray:
        return np.array([self.value(name) for name in NAMES])

    @property
    def moved_mass(self) -> float:
        """M = M_b + M_l of (6.9) as declared, without `payload_error` [kg]."""
        return self.body.table_mass + self.body.specimen_mass


def records(vectors: np.ndarray) -> np.recarray[Any, Any]:
    """Parameter vectors of shape (n, len(NAMES)) as n records for compiled code."""
    rows = np.ascontiguousarray(np.atleast_2d(vectors), dtype=np.float64)
    return rows.view(RECORD).reshape(len(rows)).view(np.recarray)
