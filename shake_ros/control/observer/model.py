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

from shake_ros.compiled import njit
from shake_ros.control.observer.law import CARRIED, CarriedTable, carry_copy, pushed, seen_motion, sensed_position
from shake_ros.control.observer.linear import LinearObserver
from shake_ros.physics.plant.integration import displace
from shake_ros.physics.plant.states import VELOCITY


@dataclass(frozen=True)
class ModelObserver(CarriedTable, LinearObserver):
    """The name of the table, and the linear observer's β and noise levels, which set the gain."""

    code: ClassVar[int] = 3
    derived: ClassVar[tuple[str, ...]] = (*LinearObserver.derived, *CARRIED)


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
    displace(state, p.position_gain * innovation)
    state[VELOCITY] += p.velocity_gain * innovation
    pushed(state, p.pressure_per_acceleration * (p.acceleration_gain * innovation + dt * disturbance))
    state[last] = disturbance + p.disturbance_gain * innovation
    push = p.pressure_per_acceleration * dt * state[last]
    seen_motion(p, model, state, last, push, 0.0, dt, work, estimate)
