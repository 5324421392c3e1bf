"""Which parameters of a table a fit may move: dotted names, scales and bounds, and the map to a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import Field, dataclass, replace
from typing import Any

import numpy as np

from shake_ros.physics.plant.parameters import FIELDS, TableParameters
from shake_ros.quantities import ShakeError, strict_keys, unknown_name


@dataclass(frozen=True)
class FreeParameter:
    """One parameter that a fit may move.

    name : dotted name. scale : a change that matters, in its unit; sets the fit's unit and its difference step.
    low, high : bounds of the fit, within those of the quantity. unit : of the quantity.
    moved_mass : for which scale and bounds are given [kg], where the quantity is a part of that mass and follows it;
    else 0.
    narrow : whether free runs bend with it within a small change, as those of a table whose parts strike each other.
    """

    name: str
    scale: float
    low: float
    high: float
    unit: str
    moved_mass: float = 0.0
    narrow: bool = False


def free_parameter(
    name: str, content: Mapping[str, Any], where: str, fields: Mapping[str, Field[Any]] = FIELDS
) -> FreeParameter:
    """A FreeParameter from `{scale:, low:, high:}`; bounds default to those of the quantity among `fields`."""
    if name not in fields:
        raise unknown_name("parameter", name, fields, where)
    strict_keys(content, ("scale", "low", "high", "start"), f"{where}: {name}", kind="key")
    metadata = fields[name].metadata
    try:
        scale = float(content["scale"])
        low = max(float(content.get("low", metadata["low"])), metadata["low"])
        high = min(float(content.get("high", metadata["high"])), metadata["high"])
    except (KeyError, TypeError, ValueError):
        raise ShakeError(
            f"{where}: {name}: needs a number 'scale', and numbers for 'low' and 'high' if given"
        ) from None
    if not (scale > 0.0 and low < high):
        raise ShakeError(f"{where}: {name}: needs scale > 0 and low < high, got {scale:g}, {low:g}, {high:g}")
    return FreeParameter(name, scale, low, high, str(metadata["unit"]))


TABLE_MASS, REST = "body.table_mass", "body.specimen_mass"  # the moved mass
NULL_SHIFT = FreeParameter("recording {}: null shift", 1e-3, -0.05, 0.05, "-")  # of one recording's valve command


def is_of_recording(name: str) -> bool:
    """Whether a free parameter is one of a recording, no number of the table."""
    return name.startswith("recording ")


def null_shifts_of(recordings: int, free: Iterable[FreeParameter]) -> list[FreeParameter]:
    """The null shift of each recording; against that of the first one where a fit moves the table's own."""
    first = any(f.name == "effects.valve_null_shift.offset" for f in free)
    return [replace(NULL_SHIFT, name=NULL_SHIFT.name.format(i)) for i in range(first, recordings)]


class FreeParameters:
    """An ordered set of free parameters over a base table.

    The fit's vector x holds value/scale of each; `vectors` maps rows of x to full parameter vectors. A part of the
    moved mass is held as such: where a fit moves that mass, the scale goes with it. What is free of one recording alone
    is no number of the table: it follows behind these, in the order of the recordings.
    """

    def __init__(self, base: TableParameters, free: Iterable[FreeParameter]) -> None:
        self.base = base
        self.free: tuple[FreeParameter, ...] = tuple(free)
        self.names: tuple[str, ...] = tuple(f.name for f in self.free)
        self.scale = np.array([f.scale for f in self.free])
        self.low = np.array([f.low for f in self.free]) / self.scale
        self.high = np.array([f.high for f in self.free]) / self.scale
        self.narrow = any(f.narrow for f in self.free)
        index = {name: i for i, name in enumerate(base.fields)}
        own = [name for name in self.names if is_of_recording(name)]
        runs = [int(name.split()[1].rstrip(":")) for name in own]
        index |= {name: len(base.fields) + run for name, run in zip(own, runs, strict=True)}
        self.columns = [index[name] for name in self.names]
        self._vector = np.concatenate([base.vector(), np.zeros(max(runs, default=-1) + 1)])
        self._parts = [i for i, f in enumerate(self.free) if f.moved_mass]
        self._whole = self.names.index(TABLE_MASS) if TABLE_MASS in self.names else None

    def start(self) -> np.ndarray:
        """x of the base table, held within the bounds, shape (len(free),)."""
        return self.x_of({})

    def scales(self, x: np.ndarray) -> np.ndarray:
        """What a unit of x means in the unit of each parameter, the moved mass held, for rows of x or one of them."""
        result = np.broadcast_to(self.scale, np.shape(x)).copy()
        for i in self._parts:
            moved = self.base.moved_mass
            if self._whole is not None:
                moved = np.asarray(x)[..., self._whole] * self.scale[self._whole] + self.base.value(REST)
            result[..., i] *= moved / self.free[i].moved_mass
        return result

    def values(self, x: np.ndarray) -> np.ndarray:
        """Value of each parameter in its unit, for rows of x or one of them."""
        return np.asarray(x) * self.scales(x)

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Derivative of each value by each element of one x, shape (p, p)."""
        result = np.diag(self.scales(x))
        if self._whole is not None:
            for i in self._parts:
                result[i, self._whole] = x[i] * self.scale[i] * self.scale[self._whole] / self.free[i].moved_mass
        return result

    def vectors(self, x: np.ndarray) -> np.ndarray:
        """Full parameter vectors for rows of x, shape (m, len(free)) → (m, len(base.fields))."""
        rows = np.atleast_2d(x)
        result = np.tile(self._vector, (len(rows), 1))
        result[:, self.columns] = self.values(rows)
        return result

    def table(self, x: np.ndarray) -> TableParameters:
        """The table with the values of x."""
        values = self.values(np.clip(np.asarray(x), self.low, self.high))
        for i in self._parts:
            limits = self.base.fields[self.names[i]].metadata
            values[i] = np.clip(values[i], limits["low"], limits["high"])
        found = dict(zip(self.names, values.tolist(), strict=True))
        return self.base.with_values({name: value for name, value in found.items() if not is_of_recording(name)})

    def x_of(self, values: Mapping[str, float]) -> np.ndarray:
        """x with some values given by name, the others from the base table."""
        wanted = self._vector[self.columns].copy()
        for name, value in values.items():
            wanted[self.names.index(name)] = value
        return np.clip(self._x(wanted), self.low, self.high)

    def rows(self, vectors: np.ndarray) -> np.ndarray:
        """Rows of x of full parameter vectors, the inverse of `vectors`."""
        return self._x(vectors[:, self.columns])

    def _x(self, values: np.ndarray) -> np.ndarray:
        return np.asarray(values / self.scales(values / self.scale))

    def x_on(self, table: TableParameters) -> np.ndarray:
        """x of a table, what is free of one recording alone as on the base."""
        return self.x_of({name: table.value(name) for name in self.names if not is_of_recording(name)})

    def extended(self, more: Sequence[FreeParameter]) -> FreeParameters:
        """These and more of them."""
        return FreeParameters(self.base, [*self.free, *(m for m in more if m.name not in self.names)])
