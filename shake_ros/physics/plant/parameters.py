"""Parameters of a table: sections as frozen dataclasses, and the flat record that compiled code reads.

A table is a tree of sections (`body`, `supply`, `valve`, …) and `effects`. Its dotted names (`valve.flow_coefficient`,
`effects.soft_zone.depth`) are the names of a YAML file, of ROS parameters, of a fit and of a report; the record's
fields are the same names with underscores for dots. Its layout lists its sections and effects: FULL_LAYOUT
is that of the sixth-order table (6.15), plant/reduced.py and plant/axis.py have the two others.

The dead time between a command and its action: that of a table, and that of the loop around it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar, cast

import numpy as np

from shake_ros.packing import field_value, name_of, union_fields
from shake_ros.physics.bulk_modulus import BULK_MODULI, BulkModulusLaw
from shake_ros.physics.effects import EFFECTS, Effect
from shake_ros.physics.friction import FRICTIONS, FrictionLaw
from shake_ros.physics.plant.options import Cavitation, Pipelines, ShearFrame
from shake_ros.physics.valve import VALVES
from shake_ros.quantities import Parameters, ShakeError, member_from, quantity, strict_keys, unknown_name

P = TypeVar("P", bound=Parameters)
ABSENT = {name: kind() for name, kind in EFFECTS.items()}  # with the values at which each does nothing
PER_MASS = {  # unit of a force in an effect → unit per moved mass
    "N": "m/s^2",
    "N/m": "1/s^2",
    "N/m^2": "1/(m*s^2)",
    "N*s^2/m^2": "1/m",
    "kg": "-",
}


@dataclass(frozen=True)
class Body(Parameters):
    """Cylinder, table and specimen, (6.4), (6.9), (6.11); with two sides that differ, (3.23), (3.24)."""

    piston_area: float = quantity("m^2", "annular piston area A_p, that of chamber A", low=1e-6, high=1.0)
    cylinder_volume: float = quantity("m^3", "total oil volume of both chambers V_t", low=1e-8, high=1.0)
    table_mass: float = quantity("kg", "mass of table, rod and piston M_b", low=1.0, high=1e6)
    specimen_mass: float = quantity("kg", "mass of the specimen M_l", low=0.0, high=1e6, live=True)
    stroke: float = quantity("m", "full stroke between the end stops", low=1e-3, high=10.0)
    end_stop_stiffness: float = quantity("N/m", "stiffness of an end stop", low=1e4, high=1e10)
    end_stop_damping: float = quantity("N*s/m", "damping of an end stop", low=0.0, high=1e8)
    area_ratio: float = quantity("-", "area of chamber B over that of A, A_B/A_A", low=0.05, high=20.0, default=1.0)
    volume_share: float = quantity("-", "share of chamber A in V_t at mid-stroke", low=0.02, high=0.98, default=0.5)
    line_volume_a: float = quantity("m^3", "oil between valve and chamber A beyond V_t", low=0.0, high=0.1, default=0.0)
    line_volume_b: float = quantity("m^3", "oil between valve and chamber B beyond V_t", low=0.0, high=0.1, default=0.0)

    @property
    def acting_area(self) -> float:
        """A_A + A_B: force per pressure that one chamber gains and the other loses [m²]."""
        return (1.0 + self.area_ratio) * self.piston_area


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


@dataclass(frozen=True)
class Family:
    """A section that any member of a family may fill."""

    members: Mapping[str, type[Parameters]]  # classes by the name that a file gives as `kind`
    declared: str  # the member of a file that names none


def per_mass(field: Field[Any]) -> Field[Any]:
    """The field of a force per moved mass; others unchanged."""
    unit = field.metadata["unit"]
    if unit not in PER_MASS:
        return field
    meaning = f"{field.metadata['meaning']}, per moved mass"
    made: Field[Any] = dataclasses.field(
        default=field.default, metadata={**field.metadata, "unit": PER_MASS[unit], "meaning": meaning}
    )
    made.name, made.type = field.name, field.type
    return made


@dataclass(frozen=True)
class TableLayout:
    """What the tables of one declared model hold."""

    name: str  # of the declared model, as effects name it
    sections: Mapping[str, type[Parameters] | Family]  # class of each section, or the family that its class is of
    optional: tuple[str, ...] = ()  # sections that a file may leave out; what they describe is absent then, at no cost
    forces_per_mass: bool = False  # whether the effects' forces count per moved mass
    without: tuple[str, ...] = ()  # dotted names that mean nothing here

    @cached_property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that make sense here."""
        return tuple(name for name, effect in EFFECTS.items() if self.name in effect.models)

    @cached_property
    def fields(self) -> Mapping[str, Field[Any]]:
        """Fields of all numbers by dotted name, in the order of the record."""
        fields: dict[str, Field[Any]] = {}
        for section, kind in self.sections.items():
            own = (
                union_fields(kind.members)
                if isinstance(kind, Family)
                else {f.name: f for f in dataclasses.fields(kind)}
            )
            fields |= {f"{section}.{name}": field for name, field in own.items()}
        for effect in self.effects:
            for field in dataclasses.fields(EFFECTS[effect]):
                fields[f"effects.{effect}.{field.name}"] = per_mass(field) if self.forces_per_mass else field
        return {name: field for name, field in fields.items() if name not in self.without}

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Dotted names of all numbers."""
        return tuple(self.fields)

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Place of each dotted name in a parameter vector."""
        return {name: i for i, name in enumerate(self.names)}

    @cached_property
    def record(self) -> np.dtype[Any]:
        """The record that compiled code reads."""
        return np.dtype([(name.removeprefix("effects.").replace(".", "_"), "f8") for name in self.names])

    def alone(self, vector: np.ndarray) -> np.ndarray[Any, Any]:
        """One parameter vector as an array of one record: compiled code takes it from Python without delay."""
        return np.array(vector, dtype=np.float64).view(self.record)

    def records(self, vectors: np.ndarray) -> np.recarray[Any, Any]:
        """Parameter vectors of shape (n, len(names)) as n records for compiled code."""
        rows = np.ascontiguousarray(np.atleast_2d(vectors), dtype=np.float64)
        return rows.view(self.record).reshape(len(rows)).view(np.recarray)

    def changes(self, given: Mapping[str, float] | None) -> dict[str, float]:
        """Values by dotted name, each given by it or by its last part alone (`specimen_mass`), as --set does."""
        return {self._full_name(key): float(value) for key, value in (given or {}).items()}

    def _full_name(self, key: str) -> str:
        matches = [name for name in self.names if key in (name, name.rpartition(".")[2])]
        if key in matches or len(matches) == 1:
            return key if key in matches else matches[0]
        if matches:
            raise ShakeError(f"set: {key}: could be {', '.join(matches)}")
        raise unknown_name("parameter", key, self.names, "set")

    def table(self, content: Any, where: str) -> TableParameters:
        """Build from the content of a YAML file; errors name the file and the section."""
        required = [section for section in self.sections if section not in self.optional]
        strict_keys(content, [*self.sections, "effects"], where, required, kind="section")
        sections = {s: self._section(s, content.get(s, {}), f"{where}: {s}") for s in self.sections}
        kind = f"effect of the model {self.name}"
        given = strict_keys(content.get("effects") or {}, self.effects, f"{where}: effects", kind=kind)
        effects = {n: EFFECTS[n].from_mapping(c or {}, f"{where}: effects.{n}") for n, c in given.items()}
        return TableParameters(self, sections, effects)

    def _section(self, section: str, content: Any, where: str) -> Parameters:
        cls = self.sections[section]
        if isinstance(cls, Family):
            return member_from(content, cls.members, where, kind=f"{section} kind", declared=cls.declared)[1]
        return cls.from_mapping(content, where)


class SectionOf(Generic[P]):
    """Typed access to a section: `table.body` is the table's `Body`; AttributeError where its layout has none."""

    def __init__(self, cls: type[P]) -> None:
        self.cls = cls

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, table: TableParameters | None, owner: type) -> P:
        if table is None or self.name not in table.sections:
            raise AttributeError(self.name)
        return cast(P, table.sections[self.name])


@dataclass(frozen=True)
class TableParameters:
    """A whole table of any layout. `effects` holds those beyond the declared model; an absent one is not in it.

    In a section of a family (`friction`, `bulk_modulus`, `valve`) a name that only another member has
    (`friction.static_level` under Tustin's law) reads as zero and cannot be set.
    """

    layout: TableLayout
    sections: Mapping[str, Parameters]
    effects: Mapping[str, Effect] = dataclasses.field(default_factory=dict)

    body = SectionOf(Body)
    supply = SectionOf(Supply)
    valve = SectionOf(Parameters)
    bulk_modulus = SectionOf(BulkModulusLaw)
    friction = SectionOf(FrictionLaw)
    leakage = SectionOf(Leakage)
    sensors = SectionOf(SensorParameters)
    cavitation = SectionOf(Cavitation)
    pipelines = SectionOf(Pipelines)
    frame = SectionOf(ShearFrame)

    def to_mapping(self) -> dict[str, Any]:
        """The tree as plain mappings, as a YAML file holds it."""
        tree: dict[str, Any] = {}
        for name, section in self.sections.items():
            kind = self.layout.sections[name]
            if isinstance(kind, Family):
                member = name_of(kind.members, section)
                tree[name] = ({"kind": member} if member != kind.declared else {}) | dataclasses.asdict(section)
            elif name not in self.layout.optional or section != kind():
                tree[name] = dataclasses.asdict(section)
        if self.effects:
            tree["effects"] = {name: dataclasses.asdict(effect) for name, effect in self.effects.items()}
        return tree

    def value(self, name: str) -> float:
        """Value of a dotted name; an absent effect's fields have their neutral values."""
        if name not in self.fields:
            raise unknown_name("parameter", name, self.fields)
        section, _, rest = name.partition(".")
        if section != "effects":
            return field_value(self.sections[section], rest)
        effect, _, field = rest.partition(".")
        return float(getattr(self.effects.get(effect) or ABSENT[effect], field))

    def with_values(self, values: Mapping[str, float]) -> TableParameters:
        """A copy with some dotted names changed, checked against their bounds; adds the effects they belong to."""
        sections, effects = dict(self.sections), dict(self.effects)
        for name, value in values.items():
            if name not in self.fields:
                raise unknown_name("parameter", name, self.fields)
            section, _, rest = name.partition(".")
            if section != "effects":
                sections[section] = sections[section].replace(**{rest: value})
            else:
                effect, _, field = rest.partition(".")
                effects[effect] = (effects.get(effect) or ABSENT[effect]).replace(**{field: value})
        return TableParameters(self.layout, sections, effects)

    def without(self, effects: Sequence[str]) -> TableParameters:
        """A copy without some effects."""
        return TableParameters(self.layout, self.sections, {n: e for n, e in self.effects.items() if n not in effects})

    def with_sections(self, **sections: Parameters) -> TableParameters:
        """A copy with whole sections replaced, say by another friction law."""
        return TableParameters(self.layout, {**self.sections, **sections}, self.effects)

    @property
    def fields(self) -> Mapping[str, Field[Any]]:
        """Fields of all numbers by dotted name, in the order of `vector`."""
        return self.layout.fields

    def vector(self) -> np.ndarray:
        """All numbers in the order of the layout's names, shape (len(names),)."""
        return self._vector.copy()

    @cached_property
    def _vector(self) -> np.ndarray:
        return np.array([self.value(name) for name in self.layout.names])

    @property
    def moved_mass(self) -> float:
        """M = M_b + M_l of (6.9) as declared, without `payload_error` [kg]."""
        return self.body.table_mass + self.body.specimen_mass


FULL_LAYOUT = TableLayout(
    "full",
    {
        "body": Body,
        "supply": Supply,
        "valve": Family(VALVES, "simplified"),
        "bulk_modulus": Family(BULK_MODULI, "constant"),
        "friction": Family(FRICTIONS, "tustin"),
        "leakage": Leakage,
        "sensors": SensorParameters,
        "cavitation": Cavitation,
        "pipelines": Pipelines,
        "frame": ShearFrame,
    },
    optional=("cavitation", "pipelines", "frame"),
)
FIELDS, NAMES, INDEX, records = FULL_LAYOUT.fields, FULL_LAYOUT.names, FULL_LAYOUT.index, FULL_LAYOUT.records


DELAY = "effects.command_delay.delay"


def dead_time(table: TableParameters, sample_time: float) -> tuple[int, float]:
    """Whole samples and fraction of a sample of the table's dead time."""
    delay = table.value(DELAY) / sample_time
    whole = math.floor(delay)
    return whole, delay - whole


def delayed_by(table: TableParameters, loop_delay: float) -> TableParameters:
    """The table as a loop sees it that delays each command by `loop_delay` [s] before the table does."""
    return table.with_values({DELAY: table.value(DELAY) + loop_delay}) if loop_delay else table
