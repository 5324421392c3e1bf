"""The observer that a record asks for: one compiled step for all, so that a whole closed loop is one compiled function.

Nothing is looked up by name within a step. `runner.Observer.compiled` gives what it takes:

    observer = Observer(kind, parameters, sample_time, model)
    law, record = observer.compiled                 # arrays of one record each: the observer's, and the model's
    state = observer.initial_state(position)        # float64 array, its length depends on the kind
    space, estimate = work(), np.empty(3)           # made once, reused at every sample
    ...                                             # inside one njit function, at every sample:
    step_observer(state, law, record, measured, command, dt, space, estimate)

changes `state` and `estimate` in place: the same numbers as `Observer.step`, which copies. `command` is the one held
since the sample before, 0 at the first. Nothing is raised: an estimate that is not finite is the caller's to find.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from shake_ros.core.compiled import njit
from shake_ros.core.dispatch import dispatch, kernel_of, written
from shake_ros.core.observer import OBSERVERS
from shake_ros.core.observer.carried import work
from shake_ros.core.packing import layout
from shake_ros.core.plant.parameters import FULL_LAYOUT, NAMES

__all__ = ["NO_MODEL", "NO_OBSERVER", "observe_run", "step_observer", "step_of", "work"]

NO_MODEL = FULL_LAYOUT.alone(np.zeros(len(NAMES)))
NO_OBSERVER = np.zeros(1, layout(OBSERVERS))  # of kind 0, which no observer has
observe = dispatch(__name__, OBSERVERS, "observe", "p.kind")


@functools.cache
def step_of(kind: str) -> Any:
    """`step_observer` for one kind alone, which compiles no other."""
    arguments = "measured, command, dt, space, estimate"
    source = f"def step_{kind}(state, law, record, {arguments}):\n    observe(state, law[0], record[0], {arguments})"
    return written(__name__, source, {"observe": kernel_of(OBSERVERS[kind], "observe")})


@njit
def step_observer(state, law, record, measured, command, dt, space, estimate):  # type: ignore[no-untyped-def]
    """One sample.

    Parameters
    ----------
    state : its state, changed in place
    law : array of one record, of `OBSERVERS`
    record : the model's, array of one record; `NO_MODEL` for an observer that carries none
    measured : now; position [m], acceleration [m/s²], P_A, P_B [Pa], NaN where there is no such sensor; more may follow
    command : u held since the sample before [-]
    dt : sample time [s]
    space : from `work`
    estimate : (3,) array for the result: position [m], velocity [m/s], acceleration [m/s²] now
    """
    observe(state, law[0], record[0], measured, command, dt, space, estimate)


@njit
def observe_run(state, law, record, measured, commands, dt, space, estimates):  # type: ignore[no-untyped-def]
    """A whole run; arguments as in `step_observer`.

    Parameters
    ----------
    measured : (n, 4) rows as there
    commands : (n,) command k is held from sample k to the next [-]; none acts before the first
    estimates : (n, 3) array for the result
    """
    for k in range(measured.shape[0]):
        command = commands[k - 1] if k > 0 else 0.0
        step_observer(state, law, record, measured[k], command, dt, space, estimates[k])
