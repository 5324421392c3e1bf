"""The spool over one integration step, before the table takes the step: nothing of the table acts back on the valve.

Under a held command the simplified valve moves by the closed form of (3.19). So the spool, by far the fastest part of
the table, does not limit the step, and a new command excites no error. Dry friction moves the position of rest by f_hs
against the motion; where the spool comes to a halt the step ends, and it goes on the other way or stays where friction
holds it. Where the speed limit could bite the two states are integrated in small steps instead; where the spool would
pass the end of its stroke the step ends there, and it goes on from rest. The detailed valve goes ahead on its own and
hands over an even motion.

Verified against the closed form, against the limits integrated in very small steps, and in the plant against Radau.
"""

from __future__ import annotations

from shake_ros.core.compiled import kernel
from shake_ros.core.plant.states import SPOOL, SPOOL_RATE
from shake_ros.core.valve.detailed import CODE as DETAILED
from shake_ros.core.valve.simplified import halt, limited_motion, motion_weights, rest_position

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
    wanted : as in `right_hand_side`. h : wanted length of the step [s]; the one returned is shorter where the spool
        comes to a halt or reaches the end of its stroke.
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
