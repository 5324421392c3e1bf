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
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.control.observer.law import CarriedTable, carry_copy, pushed, seen_motion, sensed_position
from shake_ros.control.observer.sliding_mode import injection
from shake_ros.physics.plant.integration import displace
from shake_ros.physics.plant.states import VELOCITY
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class ModelSlidingModeObserver(CarriedTable):
    """The name of the table, the gains of (6.39) and of the disturbance, the boundary layers."""

    code: ClassVar[int] = 5

    lambda1: float = quantity("m/s", "injection into the position's rate", low=1e-9)
    lambda2: float = quantity("m/s^2", "injection into the velocity's rate", low=1e-9)
    lambda3: float = quantity("m/s^3", "injection into the acceleration's rate", low=1e-9)
    lambda4: float = quantity("m/s^4", "injection into the disturbance's rate, 0 for no disturbance", low=0.0)
    boundary1: float = quantity("m", "boundary layer of the position error, 0 for a sign", low=0.0)
    boundary2: float = quantity("m/s", "boundary layer of the velocity error, 0 for a sign", low=0.0)
    boundary3: float = quantity("m/s^2", "boundary layer of the acceleration error, 0 for a sign", low=0.0)
    boundary4: float = quantity("m/s^3", "boundary layer of the disturbance's error, 0 for a sign", low=0.0)
    jerk_per_command: float = quantity("m/s^3", "jerk per unit of command, β_3 where the gains hold", low=1e-6)


@njit
def observe(state, p, model, measured, command, dt, work, estimate):  # type: ignore[no-untyped-def]
    """One sample, in place; arguments as in `model.observe`."""
    last = state.shape[0] - 1
    carry_copy(model, state, last, command + state[last], p.dead_samples, p.dead_fraction, dt, work)
    # (5.48), first stage
    gain = p.lambda1
    s = injection(measured[0] - sensed_position(model, state), gain, p.boundary1, dt)
    displace(state, dt * gain * s)
    if abs(s) < 1.0:  # E_2 (5.49)
        s = injection(gain * s, p.lambda2, p.boundary2, dt)
        gain = p.lambda2
        state[VELOCITY] += dt * gain * s
        if abs(s) < 1.0:  # E_3
            s = injection(gain * s, p.lambda3, p.boundary3, dt)
            gain = p.lambda3
            pushed(state, p.pressure_per_acceleration * dt * gain * s)
            if abs(s) < 1.0 and p.lambda4 > 0.0:  # E_4
                s = injection(gain * s, p.lambda4, p.boundary4, dt)
                state[last] += dt * p.lambda4 * s / p.jerk_per_command
    seen_motion(p, model, state, last, 0.0, 0.0, dt, work, estimate)
