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
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.observer.carried import (
    CARRIED,
    carried_numbers,
    carry_copy,
    copy_at,
    motion_ahead,
    motion_now,
    sensed_position,
)
from shake_ros.core.observer.linear import LinearObserver
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import LAGGED_POSITION, POSITION, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.core.quantities import choice, quantity


@dataclass(frozen=True)
class ModelObserver(LinearObserver):
    """The name of the table, and the linear observer's β and noise levels, which set the gain."""

    code: ClassVar[int] = 3
    carries_table: ClassVar[bool] = True
    derived: ClassVar[tuple[str, ...]] = (*LinearObserver.derived, *CARRIED)

    model: str = choice("table configuration of the model")
    loop_delay: float = quantity("s", "dead time of the feedback beyond the model's", low=0.0, high=0.1, default=0.0)
    predict: bool = choice("whether the estimate is that of the instant at which the command acts", default=False)

    def derive(self, sample_time: float, model: TableParameters | None) -> dict[str, float]:
        """The gains on the innovation, and what the copy needs."""
        assert model is not None
        return super().derive(sample_time, model) | carried_numbers(model, sample_time, self.predict)

    def started(
        self, estimate: NDArray[np.float64], command: float, sample_time: float, model: TableParameters | None
    ) -> NDArray[np.float64]:
        """The copy's state, see `carried.copy_at`, without a disturbance."""
        assert model is not None
        return np.append(copy_at(estimate, model, sample_time, command), 0.0)


@njit
def observe(state, p, model, measured, command, dt, work, estimate):  # type: ignore[no-untyped-def]
    """One sample, in place.

    Parameters
    ----------
    state : (STATES + history + 1,) array: the copy's states, its past commands, the disturbance [m/s³]
    model : the copy's record.
    p, measured, command, dt, work, estimate : as in `sliding_mode.observe`
    """
    last = state.shape[0] - 1
    carry_copy(model, state, last, command, p.dead_samples, p.dead_fraction, dt, work)
    innovation = measured[0] - sensed_position(model, state)
    disturbance = state[last]
    state[POSITION] += p.position_gain * innovation
    state[LAGGED_POSITION] += p.position_gain * innovation
    state[VELOCITY] += p.velocity_gain * innovation
    push = p.pressure_per_acceleration * (p.acceleration_gain * innovation + dt * disturbance)
    state[PRESSURE_A] += push
    state[PRESSURE_B] -= push
    state[last] = disturbance + p.disturbance_gain * innovation
    if p.ahead > 0.0:
        push = p.pressure_per_acceleration * dt * state[last]
        motion_ahead(model, state, last, push, 0.0, p.dead_samples, p.dead_fraction, dt, work, estimate)
    else:
        motion_now(model, state, work, estimate)
