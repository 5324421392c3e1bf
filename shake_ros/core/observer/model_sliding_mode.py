"""Sliding-mode observer that carries the identified table itself.

The hierarchical injection of (5.48), (5.49) and (6.39), as `sliding_mode` has it, with the whole compiled plant in
place of the reduced model: between samples a copy of the identified table is advanced under the command that acted,
dead time, soft zone, friction and valve included. At a sample the first sign acts on the copy's position; once its
surface is reached its equivalent injection is the velocity's error, and so on. The third stage's injection, a jerk,
acts as the change of the load pressure that makes it. Each sign is solved implicitly, a boundary layer included. The
fourth stage turns what the third needs steadily into a disturbance that is added to the command, so that a null shift,
a wrong flow gain or a leakage that the model lacks leaves little error: what they disturb is a flow, and the copy's own
compressibility, stiff or soft, turns the flow into pressure. λ_4 = 0 leaves the stage out. Not in the thesis.

Range of validity: |velocity error| < λ_1. Verified against: a model equal to the plant; without noise the estimate
converges onto the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.observer.carried import carry_copy, copy_at, dead_time, motion_now, sensed_position
from shake_ros.core.observer.sliding_mode import injection
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import LAGGED_POSITION, POSITION, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.core.quantities import Parameters, choice, quantity

CODE = 5
STAGES = 4
PER_COMMAND, PRESSURE, WHOLE = 2 * STAGES, 2 * STAGES + 1, 2 * STAGES + 2  # places in the packed, behind λ and δ


@dataclass(frozen=True)
class ModelSlidingModeObserver(Parameters):
    """The name of the table, the gains of (6.39) and of the disturbance, the boundary layers."""

    model: str = choice("table configuration of the model")
    lambda1: float = quantity("m/s", "injection into the position's rate", low=1e-9)
    lambda2: float = quantity("m/s^2", "injection into the velocity's rate", low=1e-9)
    lambda3: float = quantity("m/s^3", "injection into the acceleration's rate", low=1e-9)
    lambda4: float = quantity("m/s^4", "injection into the disturbance's rate, 0 for no disturbance", low=0.0)
    boundary1: float = quantity("m", "boundary layer of the position error, 0 for a sign", low=0.0)
    boundary2: float = quantity("m/s", "boundary layer of the velocity error, 0 for a sign", low=0.0)
    boundary3: float = quantity("m/s^2", "boundary layer of the acceleration error, 0 for a sign", low=0.0)
    boundary4: float = quantity("m/s^3", "boundary layer of the disturbance's error, 0 for a sign", low=0.0)
    jerk_per_command: float = quantity("m/s^3", "jerk that a unit of command makes, β_3 where the gains hold", low=1e-6)


def pack(parameters: ModelSlidingModeObserver, model: TableParameters, sample_time: float) -> NDArray[np.float64]:
    """λ, δ, jerk per command, pressure per acceleration and dead time as an array (12,)."""
    p = parameters
    gains = [p.lambda1, p.lambda2, p.lambda3, p.lambda4, p.boundary1, p.boundary2, p.boundary3, p.boundary4]
    mass = model.moved_mass + model.value("effects.payload_error.mass")
    return np.array([*gains, p.jerk_per_command, 0.5 * mass / model.body.piston_area, *dead_time(model, sample_time)])


def started(
    estimate: NDArray[np.float64], model: TableParameters, sample_time: float, command: float
) -> NDArray[np.float64]:
    """The state that continues from an estimate (3,) under a command, without a disturbance."""
    return np.append(copy_at(estimate, model, sample_time, command), 0.0)


@njit
def observe(state, parameters, p, position, command, dt, work, estimate):  # type: ignore[no-untyped-def]
    """One sample, in place; arguments as in `model.observe`, with the (12,) array from `pack`."""
    last = state.shape[0] - 1
    carry_copy(p, state, last, command + state[last], parameters[WHOLE], parameters[WHOLE + 1], dt, work)
    # (5.48), first stage
    gain = parameters[0]
    s = injection(position - sensed_position(p, state), gain, parameters[STAGES], dt)
    state[POSITION] += dt * gain * s
    state[LAGGED_POSITION] += dt * gain * s
    if abs(s) < 1.0:  # E_2 (5.49)
        s = injection(gain * s, parameters[1], parameters[STAGES + 1], dt)
        gain = parameters[1]
        state[VELOCITY] += dt * gain * s
        if abs(s) < 1.0:  # E_3
            s = injection(gain * s, parameters[2], parameters[STAGES + 2], dt)
            gain = parameters[2]
            push = parameters[PRESSURE] * dt * gain * s
            state[PRESSURE_A] += push
            state[PRESSURE_B] -= push
            if abs(s) < 1.0 and parameters[3] > 0.0:  # E_4
                s = injection(gain * s, parameters[3], parameters[STAGES + 3], dt)
                state[last] += dt * parameters[3] * s / parameters[PER_COMMAND]
    motion_now(p, state, work, estimate)
