"""One step of the table by the embedded Runge–Kutta pair 5(4) of Dormand and Prince, and the spool's path over it.

`spool_path` gives the spool at every stage of the step, which is that of the other states. Source: Dormand, Prince
1980, Journal of Computational and Applied Mathematics 6, 19. Verified against Radau at rtol 1e-9 and by the order of
convergence.

Nothing of the table acts back on the valve, so the spool goes first.

Under a held command the simplified valve moves by the closed form of (3.19). So the spool, by far the fastest part of
the table, does not limit the step, and a new command excites no error. Dry friction moves the position of rest by f_hs
against the motion; where the spool comes to a halt the step ends, and it goes on the other way or stays where friction
holds it. Where the speed limit could bite the two states are integrated in small steps instead; where the spool would
pass the end of its stroke the step ends there, and it goes on from rest. The detailed valve goes ahead on its own and
hands over an even motion.

Verified against the closed form, against the limits integrated in very small steps, and in the plant against Radau.
"""

from __future__ import annotations

import math

import numpy as np

from shake_ros.compiled import inlined_kernel, kernel, njit
from shake_ros.physics.plant.right_hand_side import table_rates
from shake_ros.physics.plant.states import CONTINUOUS, DECLARED, LARGEST_STOREYS, SPOOL, SPOOL_RATE
from shake_ros.physics.valve.detailed import DETAILED
from shake_ros.physics.valve.simplified import halt, limited_motion, motion_weights, rest_position

NODES = (1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0)  # instants of the stages in parts of the step
END = 4  # place of the step's end among the nodes
END_RATE = 5  # place of ẋ_s* at the step's end, behind the nodes
WEIGHTS = 6  # first of the weights that were used last, three for each node
USED_FOR = 21  # step, ω_v and damping they belong to
LENGTH = 24  # of the work array `path`
BISECTIONS = 40


@kernel
def free_motion(path, spool, rate, wanted, omega_v, damping, h):
    """Closed form at the nodes of a step `h` into `path`; the weights are kept for the next step of the same size."""
    if path[USED_FOR] != h or path[USED_FOR + 1] != omega_v or path[USED_FOR + 2] != damping:
        for j in range(END + 1):
            a, b, c = motion_weights(omega_v, damping, NODES[j] * h)
            path[WEIGHTS + 3 * j], path[WEIGHTS + 3 * j + 1], path[WEIGHTS + 3 * j + 2] = a, b, c
        path[USED_FOR], path[USED_FOR + 1], path[USED_FOR + 2] = h, omega_v, damping
    d = spool - wanted
    for j in range(END + 1):
        path[j] = wanted + path[WEIGHTS + 3 * j] * d + path[WEIGHTS + 3 * j + 1] * rate
    last = WEIGHTS + 3 * END
    path[END_RATE] = path[last + 2] * rate - omega_v * omega_v * path[last + 1] * d


@kernel
def limited_path(path, spool, rate, wanted, friction, omega_v, damping, limit, h):
    """The same with |ẋ_s*| ≤ limit, |x_s*| ≤ 1 and dry friction, (3.19)–(3.21)."""
    before = 0.0
    for j in range(END + 1):
        spool, rate = limited_motion(spool, rate, wanted, friction, omega_v, damping, limit, (NODES[j] - before) * h)
        before = NODES[j]
        path[j] = spool
    path[END_RATE] = rate


@kernel
def arrival(spool, rate, wanted, omega_v, damping, low, high):
    """Instant between `low` and `high` [s] at which the free motion passes the end of the stroke, (3.20)."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        a, b, _ = motion_weights(omega_v, damping, middle)
        if abs(wanted + a * (spool - wanted) + b * rate) > 1.0:
            high = middle
        else:
            low = middle
    return high


@kernel
def spool_path(p, y, wanted, h, path):
    """Spool at the nodes of a step from the state `y` into `path`, shape (LENGTH,); returns the step's length [s].

    Parameters
    ----------
    wanted : as in `right_hand_side`.
    h : wanted length of the step [s]; the one returned is shorter where the spool comes to a halt or reaches the end of
        its stroke.
    """
    spool, rate = y[SPOOL], y[SPOOL_RATE]
    if p.valve_kind == DETAILED:
        for j in range(END + 1):
            path[j] = spool + NODES[j] * h * wanted
        path[END_RATE] = wanted
        return h
    omega_v, damping = p.valve_natural_frequency * (1.0 - p.slow_valve_slowdown), p.valve_damping
    friction = p.valve_hysteresis + p.spool_hysteresis_width
    if omega_v * (abs(spool - wanted) + friction) + abs(rate) > p.valve_rate_limit:
        limited_path(path, spool, rate, wanted, friction, omega_v, damping, p.valve_rate_limit, h)
        return h
    halts = False
    if friction > 0.0:
        wanted = rest_position(spool, rate, wanted, friction)
        stop = halt(spool - wanted, rate, omega_v, damping)
        if stop <= h:
            h, halts = stop, True
    free_motion(path, spool, rate, wanted, omega_v, damping, h)
    if halts:
        path[END_RATE] = 0.0
    before = 0.0
    for j in range(END + 1):
        if abs(path[j]) > 1.0:
            h = arrival(spool, rate, wanted, omega_v, damping, before * h, NODES[j] * h)
            free_motion(path, spool, rate, wanted, omega_v, damping, h)
            path[END], path[END_RATE] = min(max(path[END], -1.0), 1.0), 0.0
            break
        before = NODES[j]
    return h


STAGES = 7
STAGE = STAGES  # row of the work array: state at a stage, at the end the state after the step
PATH = STAGES + 1  # row of the work array: see `spool_path`
PACE = STAGES + 2  # row of the work array: see `begin_sample` in integration.py
FILTER = STAGES + 3  # row of the work array: the filter behind the accelerometer, see sensors.py
ROWS = STAGES + 4
# Error scale of each continuous state: absolute part in its unit, at tolerance 1. The spool's are not used.
ABSOLUTE = np.array(
    [1e-2, 0.2, 1e6, 1e6, 1.0, 1.0]  # declared
    + [1e6, 1.0, 1e-2, 0.2, 1e-3, 0.2, 1e-2, 0.2, 20.0, 1e-2, 0.1]  # effects, friction memory
    + [1e-4, 1e-4, 1e6, 1e6]  # pipelines
    + LARGEST_STOREYS * [1e-2, 0.2]
)


@njit
def workspace():
    """Work array of an integration: rates of the stages, a state, the spool's path; shape (ROWS, CONTINUOUS)."""
    return np.zeros((ROWS, CONTINUOUS))


@inlined_kernel
def worst_error(work, y, h, first, last, worst):
    """Largest of `worst` and the errors of states first … last − 1 per scale [-]; not finite where one is not."""
    for i in range(first, last):
        slip = (
            71.0 / 57600.0 * work[0, i]
            - 71.0 / 16695.0 * work[2, i]
            + 71.0 / 1920.0 * work[3, i]
            - 17253.0 / 339200.0 * work[4, i]
            + 22.0 / 525.0 * work[5, i]
            - 1.0 / 40.0 * work[6, i]
        )
        error = abs(h * slip) / (ABSOLUTE[i] + abs(y[i]))
        if not error <= worst:  # also true for NaN
            worst = error
            if not math.isfinite(error):
                return math.inf  # a later state must not hide it
    return worst


@kernel
def dormand_prince(p, y, work, h, force, n):
    """One trial step of size h from y, with the rates at y in work[0] and the spool in work[PATH].

    Returns
    -------
    (error relative to the states' scales [-], acceleration at the end [m/s²]); the state after the step stands in
    work[STAGE], its rates in work[6].
    """
    k, stage, path = work, work[STAGE], work[PATH]
    stage[SPOOL_RATE] = path[END_RATE]
    for i in range(n):
        stage[i] = y[i] + h * (1.0 / 5.0 * k[0, i])
    stage[SPOOL] = path[0]
    table_rates(p, stage, y, force, n, k[1])
    for i in range(n):
        stage[i] = y[i] + h * (3.0 / 40.0 * k[0, i] + 9.0 / 40.0 * k[1, i])
    stage[SPOOL] = path[1]
    table_rates(p, stage, y, force, n, k[2])
    for i in range(n):
        stage[i] = y[i] + h * (44.0 / 45.0 * k[0, i] - 56.0 / 15.0 * k[1, i] + 32.0 / 9.0 * k[2, i])
    stage[SPOOL] = path[2]
    table_rates(p, stage, y, force, n, k[3])
    for i in range(n):
        stage[i] = y[i] + h * (
            19372.0 / 6561.0 * k[0, i]
            - 25360.0 / 2187.0 * k[1, i]
            + 64448.0 / 6561.0 * k[2, i]
            - 212.0 / 729.0 * k[3, i]
        )
    stage[SPOOL] = path[3]
    table_rates(p, stage, y, force, n, k[4])
    for i in range(n):
        stage[i] = y[i] + h * (
            9017.0 / 3168.0 * k[0, i]
            - 355.0 / 33.0 * k[1, i]
            + 46732.0 / 5247.0 * k[2, i]
            + 49.0 / 176.0 * k[3, i]
            - 5103.0 / 18656.0 * k[4, i]
        )
    stage[SPOOL] = path[END]
    table_rates(p, stage, y, force, n, k[5])
    for i in range(n):
        stage[i] = y[i] + h * (
            35.0 / 384.0 * k[0, i]
            + 500.0 / 1113.0 * k[2, i]
            + 125.0 / 192.0 * k[3, i]
            - 2187.0 / 6784.0 * k[4, i]
            + 11.0 / 84.0 * k[5, i]
        )
    stage[SPOOL] = path[END]
    stage[SPOOL_RATE] = path[END_RATE]
    acceleration = table_rates(p, stage, y, force, n, k[6])
    error = worst_error(work, y, h, 0, SPOOL, 0.0)
    return worst_error(work, y, h, DECLARED, n, error), acceleration
