"""What the sensors say about themselves and about the table: one compiled look at each sample.

The speed is the low-passed difference of the position. Position and acceleration are compared by an estimator that
integrates the acceleration and is drawn to the position with a bandwidth ω:

    x̂' = v̂ + 2 ω (x − x̂),   v̂' = a + ω² (x − x̂)

Its distance |x − x̂| stays small where the two belong together: an offset b of the accelerometer leaves b/ω².

The speed is also compared with that of the valve's opening, full speed times command, both low-passed alike; their
difference is low-passed once more, so that the valve's lag and the oil's spring leave little of it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.safety.causes import SENSED

POSITION_SOFT, POSITION_HARD, SPEED, ACCELERATION, FROZEN, JUMP, IMPLAUSIBLE, VALVE, SUPPLY, MISSING = range(
    len(SENSED)
)
STARTED, LAST_POSITION, LAST_ACCELERATION, VELOCITY, MODEL_POSITION, MODEL_VELOCITY, STILL_X, STILL_A, ABSENT = range(9)
EXPECTED, UNEXPLAINED = 9, 10
MEMORY = 11


def fresh_memory() -> NDArray[np.float64]:
    """Memory before the first sample."""
    return np.zeros(MEMORY)


@njit
def watch(
    limits, memory, values, position, acceleration, supply, expected, moving, dt, velocity_time, valve_time, bandwidth
):
    """Look at one sample.

    Parameters
    ----------
    limits : thresholds in the order of SENSED, shape (10,); infinite (supply: −infinite) where a cause is not active.
    memory, values : of earlier samples, shape (MEMORY,), and the value of each cause, shape (10,); changed in place.
    position [m], acceleration [m/s²], supply [Pa] : the readings. moving : whether the valve is open. dt [s].
    expected : speed that belongs to the valve's opening [m/s], NaN where the hydraulics are off.
    velocity_time, valve_time [s], bandwidth [rad/s] : of the three estimates.

    Returns
    -------
    How many causes stand.
    """
    if not (math.isfinite(position) and math.isfinite(acceleration)):
        memory[ABSENT] += dt
        values[MISSING] = memory[ABSENT]
        return 1 if values[MISSING] > limits[MISSING] else 0
    memory[ABSENT] = values[MISSING] = 0.0
    if memory[STARTED] == 0.0:
        memory[STARTED] = 1.0
        memory[LAST_POSITION] = memory[MODEL_POSITION] = position
        memory[LAST_ACCELERATION] = acceleration
    step = position - memory[LAST_POSITION]
    if dt > 0.0:
        memory[VELOCITY] += (step / dt - memory[VELOCITY]) * dt / (dt + velocity_time)
    if math.isfinite(expected):
        memory[EXPECTED] += (expected - memory[EXPECTED]) * dt / (dt + velocity_time)
        unexplained = memory[VELOCITY] - memory[EXPECTED]
        memory[UNEXPLAINED] += (unexplained - memory[UNEXPLAINED]) * dt / (dt + valve_time)
    else:
        memory[EXPECTED], memory[UNEXPLAINED] = memory[VELOCITY], 0.0
    memory[STILL_X] = memory[STILL_X] + dt if moving and step == 0.0 else 0.0
    same = acceleration == memory[LAST_ACCELERATION]
    memory[STILL_A] = memory[STILL_A] + dt if moving and same else 0.0
    error = position - memory[MODEL_POSITION]
    if dt * bandwidth < 0.5:
        memory[MODEL_VELOCITY] += dt * (acceleration + bandwidth * bandwidth * error)
        memory[MODEL_POSITION] += dt * (memory[MODEL_VELOCITY] + 2.0 * bandwidth * error)
    else:  # a long gap: nothing to compare with
        memory[MODEL_POSITION], memory[MODEL_VELOCITY], error = position, memory[VELOCITY], 0.0
    memory[LAST_POSITION], memory[LAST_ACCELERATION] = position, acceleration
    values[POSITION_SOFT] = values[POSITION_HARD] = abs(position)
    values[SPEED] = abs(memory[VELOCITY])
    values[ACCELERATION] = abs(acceleration)
    values[FROZEN] = max(memory[STILL_X], memory[STILL_A])
    values[JUMP] = abs(step)
    values[IMPLAUSIBLE] = abs(error)
    values[VALVE] = abs(memory[UNEXPLAINED])
    values[SUPPLY] = supply
    count = 0
    for i in range(len(values)):
        if i == SUPPLY:
            count += 1 if not supply >= limits[i] else 0
        elif values[i] > limits[i]:
            count += 1
    return count


def prepare() -> None:
    """Compile `watch` now: that takes some tenths of a second, which the first sample must not wait for."""
    count = len(SENSED)
    watch(np.zeros(count), fresh_memory(), np.zeros(count), 0.0, 0.0, 0.0, 0.0, False, 0.0, 0.0, 0.0, 0.0)
