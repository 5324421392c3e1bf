"""The law that a record asks for: one compiled function per task, written from the table of the laws.

Nothing is looked up by name within a step; so a whole closed loop under any law is one compiled function.
`step_controller` is the head that every law runs under: it takes the bump out of a start and of a switch from another
law.
"""

from __future__ import annotations

import numpy as np

from shake_ros.core.compiled import njit
from shake_ros.core.control import CONTROLLERS
from shake_ros.core.control.law import against_direction, saturate, with_direction
from shake_ros.core.dispatch import dispatch

STARTED, OFFSET, START_COMMAND, DECAY = range(4)  # of a controller's state, before the law's own
HEAD = 4
SEARCH = 8  # steps towards the offset, at most
CLOSE = 1e-12  # [-] command within which it is found


feedforward_law = dispatch(__name__, CONTROLLERS, "feedforward", "p.kind", name="feedforward_law")
step_law = dispatch(__name__, CONTROLLERS, "step", "p.kind", name="step_law")


@njit
def own_feedforward(law, reference):  # type: ignore[no-untyped-def]
    """The law's own feedforward from the reference [-]; `law` as in `step_controller`."""
    return feedforward_law(law[0], reference)


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
def start_offset(state, law, reference, estimate, feedforward, dt, command):  # type: ignore[no-untyped-def]
    """What must be added to the feedforward so that the law's first command is `command` [-].

    The limit plays no part in the search. Secant steps, since a law may be bent in its feedforward.
    """
    free = law.copy()
    free[0].limit = np.inf
    p = free[0]
    offset, slope = 0.0, 1.0
    _, found = step_law(state, p, reference, estimate, feedforward, dt)
    for _ in range(SEARCH):
        wrong = command - found
        if not abs(wrong) > CLOSE:
            break
        step = wrong / slope
        _, following = step_law(state, p, reference, estimate, feedforward + offset + step, dt)
        if following != found:
            slope = (following - found) / step
        offset += step
        found = following
    return offset


@njit
def step_controller(state, law, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample of a controller.

    An offset of the feedforward makes the first command the one that the state was made for (zero at a start, the last
    one at a switch) and then fades, so that neither makes a bump.

    Parameters
    ----------
    state : (HEAD + law's states,) from `initial_head` or the step before; not changed
    law : array of one record, of `CONTROLLERS`
    reference, estimate, feedforward, dt : as in `feedforward_pi.step`

    Returns
    -------
    state : new array
    u : command within ±limit [-]
    """
    own = state[HEAD:]
    offset = state[OFFSET] * state[DECAY]
    if state[STARTED] == 0.0 and state[DECAY] > 0.0:
        first = with_direction(state[START_COMMAND], law[0].flow_asymmetry)
        offset = start_offset(own, law, reference, estimate, feedforward, dt, first)
    following = np.empty_like(state)
    following[HEAD:], u = step_law(own, law[0], reference, estimate, feedforward + offset, dt)
    if law[0].flow_asymmetry != 0.0:
        u = saturate(against_direction(u, law[0].flow_asymmetry), law[0].limit)
    following[STARTED] = 1.0
    following[OFFSET] = offset
    following[START_COMMAND] = state[START_COMMAND]
    following[DECAY] = state[DECAY]
    return following, u
