"""Friction by itself: the force under a given motion, and a block that is pulled along by a spring.

For figures, tests and fits of a friction law to bench data; the plant uses the same kernels within its own
integration. The state of a contact is (z [m], memory, dwell t_d [s], F_sa [N], F_s [N]), see `at_rest`.
"""

from __future__ import annotations

import math

import numpy as np

from shake_ros.compiled import njit
from shake_ros.physics.friction import (
    armstrong,
    contact_deflection,
    contact_level,
    curve_direction,
    curve_level,
    inertia,
    is_dynamic,
    memory_rate,
    micro_damping,
    viscous_coefficient,
)

DEFLECTION, MEMORY, DWELL, AT_STOP, RISE = range(5)


@njit
def at_rest(p):
    """State of a contact after a long rest without force, shape (5,)."""
    state = np.zeros(5)
    state[AT_STOP] = state[RISE] = p.friction_stribeck_rise
    return state


@njit
def force_after(p, state, displacement, velocity_start, velocity, memory):
    """Friction force after a displacement from `state` one way, and the contact state z then: ([N], [m])."""
    viscous = viscous_coefficient(p, velocity) * velocity
    if not is_dynamic(p):
        return curve_level(p, velocity) * curve_direction(p, velocity) + viscous, 0.0
    z = contact_deflection(
        p, state[DEFLECTION], displacement, velocity_start, velocity, state[MEMORY], memory, state[RISE]
    )
    dry = p.friction_contact_stiffness * z
    share = dry / contact_level(p, velocity, memory, state[RISE])
    return dry + micro_damping(p, velocity, share) + viscous, z


@njit
def step(p, state, displacement, velocity_start, velocity, duration):
    """Carry `state` in place over a step of motion one way; returns the force at its end [N]."""
    middle = state[MEMORY] + 0.5 * duration * memory_rate(p, velocity_start, state[MEMORY])
    memory = state[MEMORY] + duration * memory_rate(p, 0.5 * (velocity_start + velocity), middle)
    force, z = force_after(p, state, displacement, velocity_start, velocity, memory)
    state[DEFLECTION], state[MEMORY] = z, memory
    if p.friction_kind == armstrong.ARMSTRONG:
        state[DWELL], state[AT_STOP], state[RISE] = armstrong.dwelt(
            p, z, memory, duration, state[DWELL], state[AT_STOP], state[RISE]
        )
    return force


@njit
def under_motion(p, velocity, dt):
    """Friction force under a given velocity, (3.52)'s acceleration part included.

    Parameters
    ----------
    p : record with a law's fields, of `packing.record`.
    velocity : shape (n,) [m/s], linear between samples.
    dt : [s].

    Returns
    -------
    shape (n,) [N], the first sample after a long rest
    """
    state = at_rest(p)
    force = np.zeros(velocity.shape[0])
    for i in range(1, velocity.shape[0]):
        v_0, v_1 = velocity[i - 1], velocity[i]
        moved = 0.5 * (v_0 + v_1) * dt
        force[i] = step(p, state, moved, v_0, v_1, dt) + inertia(p, v_1) * (v_1 - v_0) / dt
    return force


@njit
def pulled_block(p, mass, stiffness, pull, dt, every):
    """A block on a sliding contact, pulled by a spring whose other end moves as given.

    m ẍ = k (x_pull − x) − F. The oscillation of block, spring and contact must be resolved by dt; velocity Verlet
    with the contact state exact in the displacement.

    Parameters
    ----------
    mass : [kg].
    stiffness : of the spring [N/m].
    pull : position of its far end, shape (n,) [m].
    dt : [s].
    every : rows kept, one in so many.

    Returns
    -------
    shape (n // every, 4): position [m], velocity [m/s], spring force [N], friction force [N]
    """
    state = at_rest(p)
    rows = np.zeros((pull.shape[0] // every, 4))
    x, v, friction = pull[0], 0.0, 0.0
    for i in range(pull.shape[0] - 1):
        if i % every == 0 and i // every < rows.shape[0]:
            rows[i // every] = (x, v, stiffness * (pull[i] - x), friction)
        moving = mass + inertia(p, v)
        acceleration = (stiffness * (pull[i] - x) - friction) / moving
        moved = dt * (v + 0.5 * dt * acceleration)
        spring = stiffness * (pull[i + 1] - x - moved)
        v_end = v + dt * acceleration
        for _ in range(3):  # the force at the end depends on the velocity there
            memory = state[MEMORY] + dt * memory_rate(p, 0.5 * (v + v_end), state[MEMORY])
            friction, _z = force_after(p, state, moved, v, v_end, memory)
            v_end = v + 0.5 * dt * (acceleration + (spring - friction) / moving)
        friction = step(p, state, moved, v, v_end, dt)
        x += moved
        v = v_end
    return rows


def break_away_force(rows: np.ndarray, travel: float) -> float:
    """Largest friction force before the block of `pulled_block` has moved by `travel` [m]; NaN where it never does."""
    beyond = np.flatnonzero(np.abs(rows[:, 0] - rows[0, 0]) > travel)
    return float(np.max(np.abs(rows[: beyond[0] + 1, 3]))) if len(beyond) else math.nan
