"""The observer that a number asks for: one compiled step for all, so that a whole closed loop is one compiled function.

The number is compared within a step, nothing is looked up by name. `runner.Observer.compiled` gives what it takes:

    observer = Observer(kind, parameters, sample_time, model)
    code, packed, record = observer.compiled        # record: the model's, or `NO_MODEL`; one compiled type for all
    state = observer.initial_state(position)        # float64 array, its length depends on the kind
    space, estimate = work(), np.empty(3)           # made once, reused at every sample
    ...                                             # inside one njit function, at every sample:
    step_observer(code, state, packed, record, position, command, dt, space, estimate)

changes `state` and `estimate` in place: the same numbers as `Observer.step`, which copies. `command` is the one held
since the sample before, 0 at the first. Nothing is raised: an estimate that is not finite is the caller's to find.
"""

from __future__ import annotations

import numpy as np

from shake_ros.core.compiled import njit
from shake_ros.core.observer import linear, model, model_sliding_mode, robust_exact_differentiator, sliding_mode
from shake_ros.core.observer.carried import work
from shake_ros.core.plant.parameters import NAMES, records

__all__ = ["NO_MODEL", "observe_run", "step_observer", "work"]

NO_MODEL = records(np.zeros(len(NAMES)))[0]


@njit
def step_observer(code, state, packed, record, position, command, dt, space, estimate):  # type: ignore[no-untyped-def]
    """One sample of the observer with this CODE.

    Parameters
    ----------
    code : CODE of an observer's file
    state : its state, changed in place
    packed : its parameters from `pack`
    record : the model's record, `NO_MODEL` for an observer that carries none
    position : measured position now [m]
    command : u held since the sample before [-]
    dt : sample time [s]
    space : from `work`
    estimate : (3,) array for the result: position [m], velocity [m/s], acceleration [m/s²] now
    """
    if code == sliding_mode.CODE:
        sliding_mode.observe(state, packed, position, command, dt, estimate)
    elif code == linear.CODE:
        linear.observe(state, packed, position, command, dt, estimate)
    elif code == model.CODE:
        model.observe(state, packed, record, position, command, dt, space, estimate)
    elif code == robust_exact_differentiator.CODE:
        robust_exact_differentiator.observe(state, packed, position, command, dt, estimate)
    elif code == model_sliding_mode.CODE:
        model_sliding_mode.observe(state, packed, record, position, command, dt, space, estimate)
    else:
        estimate[:] = np.nan


@njit
def observe_run(code, state, packed, record, positions, commands, dt, space, estimates):  # type: ignore[no-untyped-def]
    """A whole run; arguments as in `step_observer`.

    Parameters
    ----------
    positions : (n,) measured [m]
    commands : (n,) command k is held from sample k to the next [-]; none acts before the first
    estimates : (n, 3) array for the result
    """
    for k in range(positions.shape[0]):
        command = commands[k - 1] if k > 0 else 0.0
        step_observer(code, state, packed, record, positions[k], command, dt, space, estimates[k])
