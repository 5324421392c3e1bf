"""The copy of a table that an observer carries: started at an estimate, advanced by a sample, read as motion.

The copy's state is that of `plant.table.Table`: the states of plant/states.py and behind them the latest commands,
newest first, which a dead time needs. Everything compiled works in place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.plant.dormand_prince import STAGE, workspace
from shake_ros.core.plant.integration import acceleration_now, advance_sample, hold, position_sensor
from shake_ros.core.plant.parameters import TableParameters, dead_time
from shake_ros.core.plant.right_hand_side import active_states
from shake_ros.core.plant.simulation import TOLERANCE, moving_state
from shake_ros.core.plant.states import (
    BASE,
    BASE_RATE,
    LAGGED_POSITION,
    POSITION,
    PRESSURE_A,
    PRESSURE_B,
    STATES,
    VELOCITY,
)

CARRIED = ("pressure_per_acceleration", "dead_samples", "dead_fraction", "ahead")  # of `carried_numbers`


def work() -> NDArray[np.float64]:
    """Array in which the compiled functions work; any number of observers may share it."""
    return np.asarray(workspace())


def carried_numbers(model: TableParameters, sample_time: float, predict: bool) -> dict[str, float]:
    """Pressure that one chamber gains and the other loses per acceleration; the dead time; whether it is predicted."""
    mass = model.moved_mass + model.value("effects.payload_error.mass")
    numbers = mass / model.body.acting_area, *dead_time(model, sample_time), float(predict)
    return dict(zip(CARRIED, numbers, strict=True))


def copy_at(
    estimate: NDArray[np.float64], model: TableParameters, sample_time: float, command: float
) -> NDArray[np.float64]:
    """State of a copy that is at position, velocity and acceleration (3,) under a command that has stood.

    The spool has followed the command, and the load pressure is the one that makes the acceleration, as far as
    supply and tank allow.
    """
    position, velocity, acceleration = (float(value) for value in estimate[:3])
    y = moving_state(model.vector(), position, velocity, acceleration, command or None)
    whole, _ = dead_time(model, sample_time)
    return np.concatenate([y, np.full(whole + 2, command)])


@njit
def carry_copy(p, y, end, command, whole, fraction, dt, work):  # type: ignore[no-untyped-def]
    """One sample under a held command; the commands stand in y[STATES:end]."""
    past = y[STATES:end]
    for i in range(past.shape[0] - 1, 0, -1):
        past[i] = past[i - 1]
    past[0] = min(max(command, -1.0), 1.0)
    late, timely = past[int(whole) + 1], past[int(whole)]
    advance_sample(p, y, late, timely, fraction, 0.0, dt, work, False, TOLERANCE)


@njit
def sensed_position(p, y):  # type: ignore[no-untyped-def]
    """What the model's position sensor shows, without noise and steps [m]."""
    half = 0.5 * p.sensors_position_range
    return min(max(position_sensor(p, y), -half), half)


@njit
def motion_now(p, y, work, motion):  # type: ignore[no-untyped-def]
    """Absolute position [m], velocity [m/s] and acceleration [m/s²] of the copy into `motion`, (3,)."""
    motion[0] = y[POSITION] + y[BASE]
    motion[1] = y[VELOCITY] + y[BASE_RATE]
    motion[2] = acceleration_now(p, y, work[STAGE])


@njit
def kicked(y, kick, dt):  # type: ignore[no-untyped-def]
    """Place and velocity after an acceleration [m/s²] beside the model's, in place."""
    y[POSITION] += 0.5 * dt * dt * kick
    y[LAGGED_POSITION] += 0.5 * dt * dt * kick
    y[VELOCITY] += dt * kick


@njit
def motion_ahead(p, y, end, push, kick, whole, fraction, dt, work, motion):  # type: ignore[no-untyped-def]
    """Motion when the next command begins to act, the dead time from now, under the commands that wait.

    Parameters
    ----------
    y : state whose commands stand in y[STATES:end]; not changed.
    push : load pressure that a disturbance adds to P_A and takes from P_B each sample [Pa].
    kick : acceleration by a force that the model lacks [m/s²].
    motion : as in `motion_now`
    """
    later, past, samples = y[:STATES].copy(), y[STATES:end], int(whole)
    for i in range(samples + 1):
        part = 1.0 if i < samples else fraction
        if part <= 1e-9:
            break
        if i < samples:
            late, timely = past[samples - i], past[samples - i - 1]
            advance_sample(p, later, late, timely, fraction, 0.0, dt, work, False, TOLERANCE)
        else:
            hold(p, later, past[0], 0.0, fraction * dt, active_states(p), work, False, TOLERANCE)
        later[PRESSURE_A] += part * push
        later[PRESSURE_B] -= part * push
        kicked(later, kick, part * dt)
    motion_now(p, later, work, motion)
    motion[2] += kick
