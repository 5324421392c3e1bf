"""The linear model of how a force shows beside the run of a declared model, sample by sample: that of (6.36).

Of a full table κ, ζ and φ are those of the reduced form about mid-stroke, ζ at the simulated opening of the valve.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.discovery.force_smoother import ForceDynamics
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.reduced import closed_form

Array = NDArray[np.float64]


def _of_full(table: TableParameters, run: Array, dt: float) -> ForceDynamics:
    """The oil column of (6.36), its relaxation at each opening; viscous friction apart from it."""
    beta = closed_form(table).beta
    viscous = table.value("friction.viscous") / moving_mass(table, table.moved_mass)
    closed = -beta.beta2 - viscous
    spring = np.full(len(run), max(-beta.beta1 - closed * viscous, 0.0))
    return ForceDynamics(viscous, spring, np.maximum(closed - beta.beta4 * np.abs(run[:, 6]), 0.0), dt)


def _of_reduced(table: TableParameters, run: Array, dt: float) -> ForceDynamics:
    beta = {name: table.value(f"dynamics.{name}") for name in ("beta1", "beta2", "beta4", "beta5")}
    opening = np.abs(run[:, 3])
    spring = np.maximum(-beta["beta1"] - beta["beta5"] * opening, 0.0)
    return ForceDynamics(0.0, spring, np.maximum(-beta["beta2"] - beta["beta4"] * opening, 0.0), dt)


def _of_axis(table: TableParameters, run: Array, dt: float) -> ForceDynamics:
    none = np.zeros(len(run))
    return ForceDynamics(table.value("axis.viscous") / table.value("axis.mass"), none, none, dt)


DYNAMICS: dict[str, Callable[[TableParameters, Array, float], ForceDynamics]] = {
    "full": _of_full,
    "reduced": _of_reduced,
    "axis": _of_axis,
}


def moving_mass(table: TableParameters, declared: float) -> float:
    """Declared mass with the error of the payload that was found [kg]."""
    return declared + (table.value("effects.payload_error.mass") if table.layout.name == "full" else 0.0)


def force_dynamics(table: TableParameters, run: Array, sample_time: float) -> ForceDynamics:
    """How a force shows beside a run with the columns of the table's model, shape (n, …)."""
    return DYNAMICS[table.layout.name](table, run, sample_time)
