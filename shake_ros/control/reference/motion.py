"""What every reference is made of: rows of position, velocity and acceleration that belong to one another.

What a table can do at most: stroke, velocity at full valve opening, acceleration at full pressure.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.physics.plant.cylinder import pressure_left, steady_speeds
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import Parameters, ShakeError

Array = NDArray[np.float64]

LONGEST = 4_000_000
"""Most samples of one program (about 100 MB)."""


class EarthquakeRecord(NamedTuple):
    """A recorded acceleration: uniform times [s] and acceleration [m/s²], both of shape (m,)."""

    time: Array
    acceleration: Array


class Motion(NamedTuple):
    """Samples of a reference before shaping."""

    states: Array  # (n, 3), position [m], velocity [m/s], acceleration [m/s²] at k * sample_time
    notes: dict[str, Any]  # figures worth reporting by name (factor, crest factor, ...)


@dataclass(frozen=True)
class ReferenceParameters(Parameters):
    """Base of the references."""

    @abstractmethod
    def motion(self, sample_time: float) -> Motion:
        """Its samples every `sample_time` [s]; what is played from a file takes the record as well."""


def sample_times(duration: float, sample_time: float) -> Array:
    """Times k * sample_time from 0 to `duration` rounded to whole samples [s].

    >>> sample_times(0.004, 0.001).tolist()
    [0.0, 0.001, 0.002, 0.003, 0.004]
    """
    count = round(duration / sample_time) + 1
    if count < 2:
        raise ShakeError(f"reference: duration {duration:g} s is shorter than one sample of {sample_time:g} s")
    if count > LONGEST:
        raise ShakeError(f"reference: {duration:g} s at {sample_time:g} s are {count} samples, more than {LONGEST}")
    return np.asarray(np.arange(count) * sample_time, dtype=np.float64)


def smooth_step(tau: Array) -> tuple[Array, Array, Array]:
    """The ramp 10τ³ − 15τ⁴ + 6τ⁵ between 0 and 1 and its first two derivatives by τ; constant outside.

    Value, slope and curvature are continuous, the latter two zero at both ends. Largest slope 15/8.

    >>> [float(part[0]) for part in smooth_step(np.array([0.5]))]
    [0.5, 1.875, 0.0]
    """
    t = np.clip(tau, 0.0, 1.0)
    value = t**3 * (10.0 + t * (6.0 * t - 15.0))
    slope = 30.0 * t**2 * (1.0 - t) ** 2
    curvature = 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)
    return value, slope, curvature


def product(left: tuple[Array, Array, Array], right: tuple[Array, Array, Array]) -> Array:
    """Value and first two derivatives of a product from those of its factors, as rows of shape (n, 3)."""
    f, df, ddf = left
    g, dg, ddg = right
    return np.column_stack((f * g, df * g + f * dg, ddf * g + 2.0 * df * dg + f * ddg))


def columns(states: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of rows of shape (n, 3)."""
    return states[:, 0], states[:, 1], states[:, 2]


def peaks(states: Array) -> tuple[float, float, float]:
    """Largest magnitudes of position [m], velocity [m/s] and acceleration [m/s²]."""
    largest = np.max(np.abs(states), axis=0)
    return float(largest[0]), float(largest[1]), float(largest[2])


def crest_factor(signal: Array) -> float:
    """Peak over root mean square of a signal [-]; 0 for a signal that is zero throughout.

    >>> round(crest_factor(np.sin(2 * np.pi * np.arange(1000) / 1000)), 6)
    1.414214
    """
    rms = float(np.sqrt(np.mean(np.square(signal))))
    return float(np.max(np.abs(signal))) / rms if rms > 0.0 else 0.0


class Envelope(NamedTuple):
    """Largest position [m], velocity [m/s] and acceleration [m/s²]."""

    position: float
    velocity: float
    acceleration: float


def envelope(table: TableParameters) -> Envelope:
    """The table's bounds, each with the others at zero.

    Half the stroke; C_v √((P_s − P_T)/2) / A_p, the velocity of the unloaded cylinder through both edges of the open
    valve (3.17); and A_p (P_s − P_T) / M (6.4). The velocity that is left at an acceleration a is v √(1 − a/a_max).
    Where the two areas differ, those of the weaker direction.
    """
    return Envelope(
        position=0.5 * table.body.stroke,
        velocity=min(steady_speeds(table)),  # (3.17)
        acceleration=table.body.piston_area * min(pressure_left(table)) / table.moved_mass,  # (6.4)
    )
