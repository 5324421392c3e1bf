"""One sample of one table as compiled code that a node calls: the parameter record goes in as an array of one.

A record by itself costs a call from Python 30 µs and more (numba asks numpy for a description of all its fields each
time); an array of records costs none of that.
"""

from __future__ import annotations

from shake_ros.core.compiled import njit
from shake_ros.core.plant.hydraulics import chamber_pressure
from shake_ros.core.plant.integration import acceleration_now, advance_sample, outputs
from shake_ros.core.plant.states import PRESSURE_A, PRESSURE_B


@njit
def advance_one(table, y, late, timely, fraction, force, dt, work, tolerance):
    """Integrate one sample in place, as `advance_sample` does. table : parameter records, shape (1,)."""
    return advance_sample(table[0], y, late, timely, fraction, force, dt, work, False, tolerance)


@njit
def observe_one(table, y, rates, row):
    """Outputs at state y into `row`; returns the acceleration [m/s²]. table : parameter records, shape (1,)."""
    acceleration = acceleration_now(table[0], y, rates)
    outputs(table[0], y, acceleration, row)
    return acceleration


@njit
def pressures_of_one(table, y):
    """True P_A, P_B at state y [Pa]. table : parameter records, shape (1,)."""
    return chamber_pressure(table[0], y[PRESSURE_A]), chamber_pressure(table[0], y[PRESSURE_B])
