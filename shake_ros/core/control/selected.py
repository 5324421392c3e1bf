"""The law that a number asks for: one compiled function per task, chosen by the law's `CODE`.

The number is compared within a step, nothing is looked up by name; so a whole closed loop under any law is one
compiled function. `step_controller` is the head that every law runs under: it takes the bump out of a start and of a
switch from another law.
"""

from __future__ import annotations

import numpy as np

from shake_ros.core.compiled import njit
from shake_ros.core.control import (
    feedforward_pi,
    hold,
    minimal_control_synthesis,
    pid,
    sliding_mode,
    super_twisting,
    super_twisting_implicit,
    three_variable,
)

LARGEST_STATES = 32  # no law has more of its own states
STARTED, OFFSET, START_COMMAND, DECAY = range(4)  # of a controller's state, before the law's own
HEAD = 4
SEARCH = 8  # steps towards the offset, at most
CLOSE = 1e-12  # [-] command within which it is found


@njit
def feedforward_law(code, packed, reference):  # type: ignore[no-untyped-def]
    """The law's own feedforward from the reference [-]."""
    if code == feedforward_pi.CODE:
        return feedforward_pi.feedforward(packed, reference)
    if code == sliding_mode.CODE:
        return sliding_mode.feedforward(packed, reference)
    if code == super_twisting.CODE:
        return super_twisting.feedforward(packed, reference)
    if code == minimal_control_synthesis.CODE:
        return minimal_control_synthesis.feedforward(packed, reference)
    if code == pid.CODE:
        return pid.feedforward(packed, reference)
    if code == super_twisting_implicit.CODE:
        return super_twisting_implicit.feedforward(packed, reference)
    if code == three_variable.CODE:
        return three_variable.feedforward(packed, reference)
    return hold.feedforward(packed, reference)


@njit
def step_law(code, state, packed, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample of the law itself; arguments after `code` and results as in `feedforward_pi.step`."""
    if code == feedforward_pi.CODE:
        return feedforward_pi.step(state, packed, reference, estimate, feedforward, dt)
    if code == sliding_mode.CODE:
        return sliding_mode.step(state, packed, reference, estimate, feedforward, dt)
    if code == super_twisting.CODE:
        return super_twisting.step(state, packed, reference, estimate, feedforward, dt)
    if code == minimal_control_synthesis.CODE:
        return minimal_control_synthesis.step(state, packed, reference, estimate, feedforward, dt)
    if code == pid.CODE:
        return pid.step(state, packed, reference, estimate, feedforward, dt)
    if code == super_twisting_implicit.CODE:
        return super_twisting_implicit.step(state, packed, reference, estimate, feedforward, dt)
    if code == three_variable.CODE:
        return three_variable.step(state, packed, reference, estimate, feedforward, dt)
    return hold.step(state, packed, reference, estimate, feedforward, dt)


@njit
def initial_head(states, decay, command):  # type: ignore[no-untyped-def]
    """State of a controller whose law has `states` of its own: not started, to begin at `command` [-].

    `decay` is the factor per sample by which the offset of the start fades; zero starts without one.
    """
    state = np.zeros(HEAD + states)
    state[START_COMMAND] = command
    state[DECAY] = decay
    return state


@njit
def start_offset(code, law, packed, reference, estimate, feedforward, dt, command):  # type: ignore[no-untyped-def]
    """What must be added to the feedforward so that the law's first command is `command` [-].

    The limit plays no part in the search. Secant steps, since a law may be bent in its feedforward.
    """
    free = packed.copy()
    free[0] = np.inf
    offset, slope = 0.0, 1.0
    _, found = step_law(code, law, free, reference, estimate, feedforward, dt)
    for _ in range(SEARCH):
        wrong = command - found
        if not abs(wrong) > CLOSE:
            break
        step = wrong / slope
        _, following = step_law(code, law, free, reference, estimate, feedforward + offset + step, dt)
        if following != found:
            slope = (following - found) / step
        offset += step
        found = following
    return offset


@njit
def step_controller(code, state, packed, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample of a controller.

    An offset of the feedforward makes the first command the one that the state was made for (zero at a start, the last
    one at a switch) and then fades, so that neither makes a bump.

    Parameters
    ----------
    code : number of the law
    state : (HEAD + law's states,) from `initial_head` or the step before; not changed
    packed, reference, estimate, feedforward, dt : as in `feedforward_pi.step`

    Returns
    -------
    state : new array
    u : command within ±limit [-]
    """
    law = state[HEAD:]
    offset = state[OFFSET] * state[DECAY]
    if state[STARTED] == 0.0 and state[DECAY] > 0.0:
        offset = start_offset(code, law, packed, reference, estimate, feedforward, dt, state[START_COMMAND])
    following = np.empty_like(state)
    following[HEAD:], u = step_law(code, law, packed, reference, estimate, feedforward + offset, dt)
    following[STARTED] = 1.0
    following[OFFSET] = offset
    following[START_COMMAND] = state[START_COMMAND]
    following[DECAY] = state[DECAY]
    return following, u
