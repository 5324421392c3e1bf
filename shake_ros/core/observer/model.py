"""Observer that carries the identified table itself.

Between samples the whole compiled plant, with every effect of the model and without noise, is advanced under the
command that acted; at each sample the innovation corrects position, velocity, load pressure and a disturbance, with
the constant gain that the Kalman filter of the reduced model has (`linear.kalman_gain`). The third correction, an
acceleration, enters as the load pressure that makes it; the disturbance, a jerk, as its rate. So what the model knows
(dead band, soft zone, friction, null shift, dead time) costs no estimation error, and what it does not know is left
to the disturbance. Not in the thesis. Verified against: a model equal to the plant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.observer.carried import carry_copy, copy_at, dead_time, motion_now, sensed_position
from shake_ros.core.observer.linear import LinearObserver, kalman_gain
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import LAGGED_POSITION, POSITION, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.core.quantities import choice

CODE = 3
PRESSURE, WHOLE = 4, 5  # places in the packed parameters


@dataclass(frozen=True)
class ModelObserver(LinearObserver):
    """The name of the table, and the linear observer's β and noise levels, which set the gain."""

    model: str = choice("table configuration of the model")


def pack(parameters: ModelObserver, model: TableParameters, sample_time: float) -> NDArray[np.float64]:
    """Four gains, pressure per acceleration and dead time as an array (7,)."""
    # half the load pressure's change per change of acceleration, M/(2 A_p)
    mass = model.moved_mass + model.value("effects.payload_error.mass")
    return np.array(
        [*kalman_gain(parameters, sample_time), 0.5 * mass / model.body.piston_area, *dead_time(model, sample_time)]
    )


def started(
    estimate: NDArray[np.float64], model: TableParameters, sample_time: float, command: float
) -> NDArray[np.float64]:
    """The state that continues from an estimate (3,) under a command, without a disturbance: `copy_at` and 0."""
    return np.append(copy_at(estimate, model, sample_time, command), 0.0)


@njit
def observe(state, parameters, p, position, command, dt, work, estimate):  # type: ignore[no-untyped-def]
    """One sample, in place.

    Parameters
    ----------
    state : (STATES + history + 1,) array: the copy's states, its past commands, the disturbance [m/s³]
    parameters : (7,) array from `pack`
    p : the model's record (`plant.parameters.records`)
    position, command, dt, estimate : as in `sliding_mode.observe`
    work : from `carried.work`
    """
    last = state.shape[0] - 1
    carry_copy(p, state, last, command, parameters[WHOLE], parameters[WHOLE + 1], dt, work)
    innovation = position - sensed_position(p, state)
    disturbance = state[last]
    state[POSITION] += parameters[0] * innovation
    state[LAGGED_POSITION] += parameters[0] * innovation
    state[VELOCITY] += parameters[1] * innovation
    push = parameters[PRESSURE] * (parameters[2] * innovation + dt * disturbance)
    state[PRESSURE_A] += push
    state[PRESSURE_B] -= push
    state[last] = disturbance + parameters[3] * innovation
    motion_now(p, state, work, estimate)
