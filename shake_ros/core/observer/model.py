"""Observer that carries the identified table itself.

Between samples the whole compiled plant, with every effect of the model and without noise, is advanced under the
command that acted; at each sample the innovation corrects position, velocity, load pressure and a disturbance, with
the constant gain that the Kalman filter of the reduced model has (`linear.kalman_gain`). The third correction, an
acceleration, enters as the load pressure that makes it; the disturbance, a jerk, as its rate. So what the model knows
(dead band, soft zone, friction, null shift, dead time) costs no estimation error, and what it does not know is left
to the disturbance. Not in the thesis. Verified against: a model equal to the plant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.observer.linear import LinearObserver, kalman_gain
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import LAGGED_POSITION, POSITION, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.core.plant.table import Table
from shake_ros.core.quantities import ShakeError, choice


@dataclass(frozen=True)
class ModelObserver(LinearObserver):
    """The name of the table, and the linear observer's β and noise levels, which set the gain."""

    model: str = choice("table configuration of the model")


class ModelFilter:
    """`initial_state` and `step` of the observer on one table at one sample time.

    The state is the copy's state with the disturbance [m/s³] behind it.
    """

    def __init__(self, parameters: ModelObserver, sample_time: float, model: TableParameters | None) -> None:
        if model is None:
            raise ShakeError(f"observer 'model': the table '{parameters.model}' of its model was not handed over")
        silent = {f"sensors.{name}_noise": 0.0 for name in ("position", "acceleration", "pressure")}
        self._table = Table(model.with_values({**silent, "sensors.position_bits": 0}), sample_time)
        self._gain = kalman_gain(parameters, sample_time)
        self._sample_time = sample_time
        # half the load pressure's change per change of acceleration, M/(2 A_p)
        mass = model.moved_mass + model.value("effects.payload_error.mass")
        self._pressure = 0.5 * mass / model.body.piston_area

    def initial_state(self, position: float) -> NDArray[np.float64]:
        """At rest at a position [m], no disturbance."""
        return np.append(self._table.initial_state(position), 0.0)

    def step(
        self, state: NDArray[np.float64], position: float, command: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """One sample; arguments and results as in `sliding_mode.step`."""
        table, disturbance = self._table.advance(state[:-1], command), state[-1]
        innovation = position - self._table.measure(table, 0).position
        to_position, to_velocity, to_acceleration, to_disturbance = self._gain * innovation
        table[POSITION] += to_position
        table[LAGGED_POSITION] += to_position
        table[VELOCITY] += to_velocity
        push = self._pressure * (to_acceleration + self._sample_time * disturbance)
        table[PRESSURE_A] += push
        table[PRESSURE_B] -= push
        m = self._table.measure(table, 0)
        if not math.isfinite(m.truth_acceleration):
            raise ShakeError("observer: the model's state left the finite numbers")
        estimate = np.array([m.truth_position, m.truth_velocity, m.truth_acceleration])
        return np.append(table, disturbance + to_disturbance), estimate
