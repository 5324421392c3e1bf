"""A table with what a fit may move: its numbers, the effects that it has, and what the sensors add."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters

TABLE = len(FULL_LAYOUT.names)
SENSOR_DELAY = FreeParameter("sensor.delay", 5e-4, -0.005, 0.05, "s")  # of the accelerometer behind the position
SENSOR_FILTER = FreeParameter("sensor.filter", 5e-4, 0.0, 0.03, "s")  # √2/ω_c of its anti-aliasing filter
SENSOR_SCALE = FreeParameter("sensor.pressure_scale", 0.05, 0.01, 100.0, "-")  # of pressures that have no unit
SENSOR = {SENSOR_DELAY.name: 0.0, SENSOR_FILTER.name: 0.0, SENSOR_SCALE.name: 1.0}  # values where they do not move
WIDTH = TABLE + len(SENSOR)


@dataclass(frozen=True)
class TriedEffect:
    """Something that a model may lack, as data.

    Attributes
    ----------
    name : of the effect.
    free : its parameters, the one that is zero where it is absent first.
    trials : finite values by dotted name at which its presence is tried; several directions are tried in combination.
    place : where it acts.
    penalties : weak priors, each a linear combination of parameters that is zero within a standard deviation, in units
        of their scales.
    depends_on : quantities.
    scaled : numbers in proportion to the multiple of a direction.
    title : for a reader, where the name does not say all.
    """

    name: str
    free: tuple[FreeParameter, ...]
    trials: tuple[tuple[Mapping[str, float], ...], ...]
    place: str
    penalties: tuple[tuple[Mapping[str, float], float], ...] = ()
    depends_on: tuple[str, ...] = ()
    scaled: tuple[str, ...] = ()
    title: str = ""

    @property
    def called(self) -> str:
        """What a reader is shown."""
        return self.title or self.name

    @property
    def strength(self) -> FreeParameter:
        """The parameter that is zero where the effect is absent."""
        return self.free[0]

    @property
    def signed(self) -> bool:
        """Whether its strength can have either sign."""
        return self.strength.low < 0.0

    def with_trial(self, values: Mapping[str, float]) -> TriedEffect:
        """The same with one trial more."""
        return replace(self, trials=(*self.trials, (values,)))

    def with_least(self, strength: float) -> TriedEffect:
        """The same with a strength that is not below a value."""
        return replace(self, free=(replace(self.strength, low=max(self.strength.low, strength)), *self.free[1:]))


@dataclass(frozen=True)
class FreeModel:
    """A table, the parameters that a fit moves, and the values that it has found.

    Attributes
    ----------
    table : numbers that do not move, effects included, and those that move as declared. free : parameters that move.
    effects : candidates that the model has. x : values in units of the scales, shape (p,).
    priors : value and standard deviation by name.
    """

    table: TableParameters
    free: tuple[FreeParameter, ...]
    effects: tuple[TriedEffect, ...]
    x: np.ndarray
    priors: Mapping[str, tuple[float, float]]
    sensor: tuple[float, ...] = tuple(SENSOR.values())

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that move."""
        return tuple(p.name for p in self.free)

    @cached_property
    def scale(self) -> np.ndarray:
        """Scales, shape (p,)."""
        return np.array([p.scale for p in self.free])

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds in units of the scales, two of shape (p,)."""
        return np.array([p.low for p in self.free]) / self.scale, np.array([p.high for p in self.free]) / self.scale

    @cached_property
    def columns(self) -> np.ndarray:
        """Places in a parameter vector, shape (p,)."""
        index = {**self.table.layout.index, **{n: self._own + i for i, n in enumerate(SENSOR)}}
        return np.array([index[n] for n in self.names], dtype=np.int64)

    @property
    def _own(self) -> int:
        """Number of the table's own parameters, before the sensors'."""
        return len(self.table.layout.names)

    @cached_property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the effects that it has."""
        return tuple(c.name for c in self.effects)

    def vectors(self, rows: np.ndarray) -> np.ndarray:
        """Parameter vectors for rows of x, shape (m, width)."""
        rows = np.atleast_2d(rows)
        made = np.empty((len(rows), self._own + len(SENSOR)))
        made[:, : self._own] = self.table.vector()
        made[:, self._own :] = self.sensor
        made[:, self.columns] = rows * self.scale
        return made

    def value(self, name: str) -> float:
        """Value of a parameter that moves, in its unit."""
        i = self.names.index(name)
        return float(self.x[i] * self.scale[i])

    @cached_property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows A and targets b of the priors, whose residuals are A x − b; shapes (k, p) and (k,)."""
        rows, targets = list[np.ndarray](), list[float]()
        place = {n: i for i, n in enumerate(self.names)}
        for name, (value, deviation) in self.priors.items():
            if name in place:
                rows.append(np.zeros(len(self.x)))
                rows[-1][place[name]] = self.scale[place[name]] / deviation
                targets.append(value / deviation)
        for candidate in self.effects:
            for combination, deviation in candidate.penalties:
                rows.append(np.zeros(len(self.x)))
                for name, weight in combination.items():
                    rows[-1][place[name]] = weight / deviation
                targets.append(0.0)
        return np.array(rows).reshape(len(rows), len(self.x)), np.array(targets)

    def at(self, x: np.ndarray) -> FreeModel:
        """The same with other values."""
        return replace(self, x=np.clip(x, *self.bounds))

    def with_effect(self, candidate: TriedEffect, values: Mapping[str, float]) -> FreeModel:
        """The same with one effect more, at these values."""
        limits = {p.name: p for p in candidate.free}
        start = [np.clip(values.get(p.name, self.table.value(p.name)), p.low, p.high) / p.scale for p in candidate.free]
        fixed = {n: v for n, v in values.items() if n not in limits}
        table = self.table.with_values(
            {**{p.name: p.scale * s for p, s in zip(candidate.free, start, strict=True)}, **fixed}
        )
        return replace(
            self,
            table=table,
            free=(*self.free, *candidate.free),
            effects=(*self.effects, candidate),
            x=np.concatenate([self.x, start]),
        )

    def without(self, name: str) -> FreeModel:
        """The same without an effect."""
        (candidate,) = (c for c in self.effects if c.name == name)
        gone = {p.name for p in candidate.free}
        keep = [i for i, p in enumerate(self.free) if p.name not in gone]
        return replace(
            self,
            table=self.table.without([name]),
            free=tuple(self.free[i] for i in keep),
            effects=tuple(c for c in self.effects if c.name != name),
            x=self.x[keep],
        )

    def found_table(self) -> TableParameters:
        """The table with the values found."""
        vector = self.vectors(self.x)[0]
        own = [(p, float(vector[c])) for p, c in zip(self.free, self.columns, strict=True) if p.name not in SENSOR]
        return self.table.with_values({p.name: min(max(v, p.low), p.high) for p, v in own})  # x · scale is rounded


def start_of(table: TableParameters, free: Sequence[FreeParameter]) -> FreeModel:
    """A model at the values of its table and of sensors without errors."""
    model = FreeModel(table, tuple(free), (), np.zeros(len(free)), {})
    return model.at(np.array([(SENSOR[p.name] if p.name in SENSOR else table.value(p.name)) / p.scale for p in free]))
