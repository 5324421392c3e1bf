"""Observers as nodes and simulations run them: state in, state and estimate out; checks what comes from outside.

The observer that a record asks for: one compiled step for all, so that a whole closed loop is one compiled function.

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
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.law import SENSORS, CarriedTable, ObserverParameters, work
from shake_ros.packing import dispatch, kernel_of, layout, records, refuse_mismatch, written
from shake_ros.physics.plant.parameters import DELAY, FULL_LAYOUT, NAMES, TableParameters, delayed_by
from shake_ros.quantities import ShakeError

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


Array = NDArray[np.float64]
ABSENT = (math.nan,) * len(SENSORS)


class Compiled(NamedTuple):
    """What `step_observer` takes, arrays of one record: the observer's and the model's."""

    law: Array
    record: Array


class Observer:
    """An observer of one kind at one sample time; holds no state of its own.

    Parameters
    ----------
    kind : a name in `OBSERVERS`.
    parameters : of that kind's class.
    sample_time : [s]
    model : the table that an observer with `carries_table` carries; the others do without.

    Attributes
    ----------
    lead : by which the estimate is later than the measurement [s]: the whole dead time with `predict`, else none.

    Raises
    ------
    UnknownName, ShakeError : unknown kind, parameters of another kind, sample time not positive, model missing.
    """

    def __init__(
        self, kind: str, parameters: ObserverParameters, sample_time: float, model: TableParameters | None = None
    ) -> None:
        refuse_mismatch("observer", kind, parameters, OBSERVERS, sample_time)
        self.kind = kind
        self.parameters = parameters
        self.sample_time = float(sample_time)
        self._model, self.lead, record = None, 0.0, NO_MODEL
        if isinstance(parameters, CarriedTable):
            if model is None:
                raise ShakeError(f"observer '{kind}': the table '{parameters.model}' of its model was not given")
            self._model = delayed_by(model, parameters.loop_delay)
            self.lead = self._model.value(DELAY) if parameters.predict else 0.0
            record = FULL_LAYOUT.alone(self._model.vector())
        derived = parameters.derive(self.sample_time, self._model)
        self.compiled = Compiled(records(OBSERVERS, parameters, derived=derived), record)
        self._step = step_of(kind)
        self._work = work()

    def initial_state(self, position: float) -> Array:
        """At rest at a position [m]."""
        if not math.isfinite(position):
            raise ShakeError(f"observer: initial position is {position!r}")
        return self.started(np.array([position, 0.0, 0.0]), 0.0)

    def started(self, estimate: Array, command: float) -> Array:
        """The state that continues from the estimate of another observer under the command that stands.

        Parameters
        ----------
        estimate : (3,) position [m], velocity [m/s], acceleration [m/s²]
        command : [-]
        """
        return self.parameters.started(estimate, command, self.sample_time, self._model)

    def step(
        self, state: Array, measured_position: float, u_previous: float, others: Sequence[float] = ABSENT
    ) -> tuple[Array, Array]:
        """One sample.

        Parameters
        ----------
        state : from `initial_state`, `started` or the step before; not changed.
        measured_position : now [m]
        u_previous : command held since the sample before [-]
        others : acceleration [m/s²], P_A, P_B [Pa] now, NaN where there is no such sensor

        Returns
        -------
        (state, estimate) : new arrays; estimate is (3,): position [m], velocity [m/s], acceleration [m/s²] now.

        Raises
        ------
        ShakeError : a measurement or command that is not a finite number; a carried model that diverged.
        """
        if not (math.isfinite(measured_position) and math.isfinite(u_previous)):
            raise ShakeError(f"observer: position {measured_position!r}, command {u_previous!r} not finite")
        following, estimate = state.copy(), np.empty(3)
        measured = np.array([measured_position, *others])
        given = measured, float(u_previous), self.sample_time
        self._step(following, *self.compiled, *given, self._work, estimate)
        if self._model is not None and not np.isfinite(estimate).all():
            raise ShakeError("observer: the model's state diverged")
        return following, estimate

    def run(self, positions: Array, commands: Array, others: Array | None = None) -> Array:
        """Estimates of a whole recording, (n, 3), from rest; the numbers of `step`, in compiled code.

        Parameters
        ----------
        positions : (n,) measured [m]
        commands : (n,) command k is held from sample k to the next [-]
        others : (n, 3) acceleration [m/s²], P_A, P_B [Pa], NaN where there is no such sensor; None for none at all

        Raises
        ------
        ShakeError : series of different length, a value that is not finite, a model that diverged.
        """
        given, held = np.ascontiguousarray(positions, float), np.ascontiguousarray(commands, float)
        if given.ndim != 1 or given.shape != held.shape or not given.size:
            raise ShakeError(f"observer: positions of shape {given.shape} and commands of shape {held.shape}")
        if not (np.isfinite(given).all() and np.isfinite(held).all()):
            raise ShakeError("observer: a position or command is not finite")
        measured = np.full((given.size, 1 + len(SENSORS)), np.nan)
        measured[:, 0] = given
        if others is not None:
            measured[:, 1:] = others
        estimates = np.empty((given.size, 3))
        state = self.initial_state(given[0])
        observe_run(state, *self.compiled, measured, held, self.sample_time, self._work, estimates)
        if not np.isfinite(estimates).all():
            raise ShakeError("observer: the estimate diverged")
        return estimates
