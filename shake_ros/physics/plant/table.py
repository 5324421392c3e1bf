"""The simulated table as a node drives it: measure, then advance one sample.

The parameter record goes into compiled code as an array of one. A record by itself costs a call from Python 30 µs and
more (numba asks numpy for a description of all its fields each time); an array of records costs none of that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shake_ros.compiled import njit
from shake_ros.physics.plant.dormand_prince import STAGE, workspace
from shake_ros.physics.plant.integration import OUTPUTS, acceleration_now, advance_late, outputs
from shake_ros.physics.plant.options import chamber_pressure
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters, dead_time
from shake_ros.physics.plant.sensors import SensorNoise
from shake_ros.physics.plant.simulation import TOLERANCE, initial_state
from shake_ros.physics.plant.states import BASE, BASE_RATE, POSITION, PRESSURE_A, PRESSURE_B, STATES, VELOCITY
from shake_ros.quantities import ShakeError


@njit
def advance_one(table, y, u, whole, fraction, force, dt, work):
    """Integrate one sample in place, as `advance_late` does. table : parameter records, shape (1,)."""
    return advance_late(table[0], y, y[STATES:], u, whole, fraction, force, dt, work, False, TOLERANCE)


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


class Measurement(NamedTuple):
    """Sensors and truth of one sampling instant, SI units."""

    position: float
    acceleration: float
    pressure_a: float
    pressure_b: float
    pressure_supply: float
    truth_position: float
    truth_velocity: float
    truth_acceleration: float


class Table:
    """A table with fixed parameters; the state goes in and comes out.

    Parameters
    ----------
    parameters : the table.
    sample_time : [s].
    seed : of the sensor noise.

    The state is a float64 array of shape (STATES + history,): the states of plant/states.py and behind them the
    latest commands, newest first, which a dead time needs.
    """

    def __init__(self, parameters: TableParameters, sample_time: float = 0.001, seed: int = 0) -> None:
        if not (math.isfinite(sample_time) and 0.0 < sample_time <= 0.1):
            raise ShakeError(f"sample_time = {sample_time!r} is outside 0 … 0.1 s")
        self.parameters = parameters
        self.sample_time = sample_time
        self._vector = parameters.vector()
        self._records = FULL_LAYOUT.alone(self._vector)
        self._noise = SensorNoise(parameters.sensors, seed)
        self._whole, self._fraction = dead_time(parameters, sample_time)
        self._history = self._whole + 2
        self._work = workspace()
        self._row = np.zeros(OUTPUTS)

    def set_supply_pressure(self, pressure: float) -> None:
        """From the next sample on, the power unit delivers `pressure` [Pa] (it starts, stops or fails)."""
        self._records["supply_supply_pressure"] = pressure

    def initial_state(self, position: float = 0.0) -> np.ndarray:
        """State at rest at `position` [m], valve at null."""
        return np.concatenate([initial_state(self._vector, position), np.zeros(self._history)])

    def measure(self, state: np.ndarray, k: int) -> Measurement:
        """Sensors at sample k and the truth behind them; noise depends on the seed and k alone."""
        acceleration = self.true_acceleration(state)
        position, _, measured, p_a, p_b, p_s, _ = self._row.tolist()
        read = self._noise.read(k, position, measured, p_a, p_b, p_s)
        truth = float(state[POSITION] + state[BASE]), float(state[VELOCITY] + state[BASE_RATE]), acceleration
        return Measurement(*read, *truth)

    def true_acceleration(self, state: np.ndarray) -> float:
        """At a state [m/s²]."""
        return float(observe_one(self._records, state, self._work[STAGE], self._row))

    def pressures(self, state: np.ndarray) -> tuple[float, float]:
        """True P_A, P_B of a state [Pa]: those that act, where a void has opened not those of the liquid."""
        pressure_a, pressure_b = pressures_of_one(self._records, state)
        return float(pressure_a), float(pressure_b)

    def advance(self, state: np.ndarray, u: float, force: float = 0.0) -> np.ndarray:
        """The state one sample later under the held command u and an external force [N].

        Raises
        ------
        ShakeError : command not finite, or the state diverged.
        """
        if not math.isfinite(u) or not math.isfinite(force):
            raise ShakeError(f"valve command {u!r} with force {force!r} is not finite")
        y = state.copy()
        acting, late = min(max(u, -1.0), 1.0), (self._whole, self._fraction)
        advance_one(self._records, y, acting, *late, force, self.sample_time, self._work)
        if not math.isfinite(y[VELOCITY]) or not math.isfinite(y[POSITION]):
            raise ShakeError("the simulated table diverged")
        return y
