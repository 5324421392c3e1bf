"""Controllers as nodes and simulations run them: state in, state and command out; limits, start, model feedforward.

The law that a record asks for: one compiled function per task, written from the table of the laws.

Nothing is looked up by name within a step; so a whole closed loop under any law is one compiled function.
`step_controller` is the head that every law runs under: it takes the bump out of a start and of a switch from another
law.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.law import LawParameters, against_direction, saturate, with_direction
from shake_ros.control.laws.virtual_table import VirtualTable
from shake_ros.packing import dispatch, records, refuse_mismatch
from shake_ros.physics.plant.parameters import TableParameters, delayed_by
from shake_ros.quantities import ShakeError

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

    The search does not use the limit. Secant steps, since a law may be bent in its feedforward.
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


class Controller:
    """A controller of one kind at one sample time; holds no state of its own.

    Parameters
    ----------
    kind : a name in `CONTROLLERS`.
    parameters : of that kind's class.
    sample_time : [s]
    model : table whose virtual copy makes the feedforward; needed where `parameters.model` names one.

    Attributes
    ----------
    law : what `step_controller` takes, an array of one record.
    law_size : length of the state without the virtual table's.
    model : the table that it carries, with the loop's delay, None without one.
    virtual : the virtual table of the model, None without one.
    lead : by which the estimate has to be later than its measurement [s]: the whole dead time with `predict`.

    Raises
    ------
    UnknownName, ShakeError : unknown kind, parameters of another kind, sample time not positive, model missing.
    """

    def __init__(
        self, kind: str, parameters: LawParameters, sample_time: float, model: TableParameters | None = None
    ) -> None:
        refuse_mismatch("controller", kind, parameters, CONTROLLERS, sample_time)
        self.kind = kind
        self.parameters = parameters
        self.sample_time = float(sample_time)
        self.model = model and delayed_by(model, parameters.loop_delay)
        if parameters.model and model is None:
            raise ShakeError(f"controller '{kind}': the table '{parameters.model}' of its model was not given")
        if parameters.predict and model is None:
            raise ShakeError(f"controller '{kind}': predict needs a model")
        self.virtual: VirtualTable | None = None
        if self.model is not None:
            p = parameters
            settings = p.model_bandwidth, p.model_horizon, p.limit, p.model_rate, p.predict
            self.virtual = VirtualTable(self.model, self.sample_time, *settings)
        self.lead = self.virtual.settings.lead if self.virtual is not None else 0.0
        acting = parameters.under_model().replace(flow_asymmetry=0.0) if self.virtual else parameters
        self.law = records(CONTROLLERS, acting)
        self.law_size = HEAD + parameters.states

    def carries_on(self, other: Controller) -> bool:
        """Whether its virtual table is the same as that of `other`, so that one can go on with the other's state."""
        mine, others = self.virtual, other.virtual
        return mine is not None and others is not None and (self.model, mine.settings) == (other.model, others.settings)

    def initial_state(self, command: float = 0.0, start_time: float | None = None) -> NDArray[np.float64]:
        """Not started, all integrals zero.

        Parameters
        ----------
        command : at which the first sample begins [-]: zero, or the last one of the controller before.
        start_time : time constant in which the difference fades [s]; None takes the parameters' own.
        """
        fading = self.parameters.start_time if start_time is None else start_time
        decay = math.exp(-self.sample_time / fading) if fading > 0.0 else 0.0
        head = initial_head(self.parameters.states, decay, float(command))
        return np.concatenate([head, np.zeros(self.virtual.size if self.virtual else 0)])

    def step(self, state: NDArray[np.float64], reference: Any, estimate: Any) -> tuple[NDArray[np.float64], float]:
        """One sample.

        The first sample's command is that of `initial_state`: an offset takes the difference to the law's first demand
        away and then fades with the start time, so that switching on away from the reference makes no bump.

        Parameters
        ----------
        state : from `initial_state` or the step before; not changed.
        reference, estimate : three numbers each, position [m], velocity [m/s], acceleration [m/s²]

        Returns
        -------
        (state, u) : new array; command within ±limit [-]

        Raises
        ------
        ShakeError : a reference or estimate that is not finite.
        """
        r = np.array(reference, dtype=np.float64)
        z = np.array(estimate, dtype=np.float64)
        if r.shape != (3,) or z.shape != (3,):
            raise ShakeError(f"controller: expected three numbers each, got {r.shape} and {z.shape}")
        if not (np.isfinite(r).all() and np.isfinite(z).all()):
            raise ShakeError(f"controller: reference {r.tolist()} or estimate {z.tolist()} not finite")
        following = np.empty_like(state)
        if self.virtual is None:
            command = own_feedforward(self.law, r)
        else:
            following[self.law_size :], command, r = self.virtual.step(state[self.law_size :], reference)
        following[: self.law_size], u = step_controller(
            state[: self.law_size], self.law, r, z, command, self.sample_time
        )
        return following, float(u)


def refuse_another_instant(lead: float, controller: Controller) -> None:
    """An observer that predicts needs a controller that does, through the same dead time, and the other way round.

    Parameters
    ----------
    lead : by which the estimate is later than its measurement [s].

    Raises
    ------
    ShakeError : it differs by more than half a sample from what the controller takes it for.
    """
    if abs(lead - controller.lead) <= 0.5 * controller.sample_time:
        return
    raise ShakeError(
        f"observer and controller must both predict through the same dead time, or neither: the estimate is "
        f"{1e3 * lead:.3g} ms ahead of its measurement, the controller takes it for {1e3 * controller.lead:.3g} ms"
    )


def switch(
    old: Controller, state: NDArray[np.float64], new: Controller, command: float, switch_time: float
) -> NDArray[np.float64]:
    """State of `new`, which takes over from `old` at its last command without a bump.

    The first command of `new` is `command`; the difference to what it would have demanded fades with `switch_time` [s].
    A virtual table that both have goes on where it is, so that the model feedforward runs through.
    """
    if old.sample_time != new.sample_time:
        raise ShakeError(f"controller: sample times {old.sample_time:g} and {new.sample_time:g} s differ")
    following = new.initial_state(command, switch_time)
    if new.carries_on(old):
        following[new.law_size :] = state[old.law_size :]
    return following
