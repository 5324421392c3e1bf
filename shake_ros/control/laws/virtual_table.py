"""Model feedforward from a virtual table: the command under which the identified model follows the reference.

The controller carries a copy of the identified table, the whole compiled plant with every effect that it has, without
noise. At each sample the command is sought which, held over a short horizon, brings the copy onto the surface

    s = e_3 + 2 ω e_2 + ω² e_1 = 0 at t + H,   e = virtual table − reference,

where the reference at t + H is continued from its position, velocity, acceleration and the difference of its last two
accelerations. s rises with the command, so a few secant steps inside a bracket find it, whatever stands between
the command and the table: dead band, null shift, soft zone, the valve's backlash, friction, dead time. No inverse is
written by hand. Backlash between rod and table is closed in the copy: within it no command moves the table, and the one
that crossed it at once would be the limit.
With a lead the copy has no dead time and runs ahead of the table by it: its motion is that of the instant at which the
command acts, and the reference is continued so much further.
Where the reference reverses, dry friction asks for a jump of the pressure, which a short horizon answers by one of the
command; with a rate of its own the command does not jump further than a valve follows and an interlock suffers.
The copy then takes that command for one sample, and the command is the feedforward of the real table, whose own
feedback has to deal with what the model lacks. Not in the thesis, whose feedforward is α_4 ẋ_ref.

Verified against: a model equal to the plant, which then tracks to within the horizon's error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.physics.plant.dormand_prince import STAGE, workspace
from shake_ros.physics.plant.integration import acceleration_now, advance_late
from shake_ros.physics.plant.options import set_load
from shake_ros.physics.plant.parameters import DELAY, FULL_LAYOUT, TableParameters, dead_time
from shake_ros.physics.plant.simulation import initial_state, weigh
from shake_ros.physics.plant.states import BASE, CONTINUOUS, LAGGED_POSITION, POSITION, STATES, VELOCITY
from shake_ros.quantities import OutOfBounds, ShakeError

FINE = 1e-4  # relative local error of an integration step of the copy
COARSE = 1e-3  # the same within a prediction
EVALUATIONS = 5  # predictions per sample, at most
NARROW = 1e-4  # [-] command interval at which the search ends
STARTED, COMMAND, REFERENCE_ACCELERATION = range(3)  # of the state, before the copy's states
HEAD = 3


class Settings(NamedTuple):
    """Dead time in whole samples and a fraction, samples of the horizon, bandwidth [rad/s], limit [-], dt, lead [s]."""

    whole: int
    fraction: float
    samples: int
    bandwidth: float
    limit: float
    sample_time: float
    lead: float
    most: float  # largest change of the command in a sample [-]


@njit
def carry(p, y, u, settings, samples, tolerance):  # type: ignore[no-untyped-def]
    """`y` (states, then past commands, newest first) carried in place over samples under a held command u."""
    whole, fraction, dt = settings.whole, settings.fraction, settings.sample_time
    work = workspace()
    past = y[STATES:]
    acceleration = acceleration_now(p, y, work[STAGE])
    known = False
    for _ in range(samples):
        acceleration = advance_late(p, y, past, u, whole, fraction, 0.0, dt, work, known, tolerance)
        known = True
    return acceleration


@njit
def miss(p, y, u, target, settings):  # type: ignore[no-untyped-def]
    """s at the horizon under a held command u [m/s²]."""
    ahead, omega = y.copy(), settings.bandwidth
    acceleration = carry(p, ahead, u, settings, settings.samples, COARSE)
    return (
        acceleration
        - target[2]
        + 2.0 * omega * (ahead[VELOCITY] - target[1])
        + omega * omega * (ahead[POSITION] + ahead[BASE] - target[0])
    )


@njit
def seek(p, y, start, target, settings, least, most):  # type: ignore[no-untyped-def]
    """The command from least to most for which `miss` vanishes: secant steps, kept inside the bracket found so far."""
    low, high = least, most
    s_low, s_high = np.nan, np.nan
    u = min(max(start, low), high)
    for count in range(EVALUATIONS):
        s = miss(p, y, u, target, settings)
        if s > 0.0:
            high, s_high = u, s
        else:
            low, s_low = u, s
        if math.isfinite(s_low) and math.isfinite(s_high):
            if high - low < NARROW:
                break
            guess = low - s_low * (high - low) / (s_high - s_low)
            guess = min(max(guess, low + 0.05 * (high - low)), high - 0.05 * (high - low))
        else:
            step = 0.02 * 3.0**count
            guess = u - step if s > 0.0 else u + step
            if guess <= least or guess >= most:
                return min(max(guess, least), most)
        u = guess
    return u


@njit
def ahead(state, reference, tau, dt):  # type: ignore[no-untyped-def]
    """The reference continued by τ, with the jerk of its last two accelerations, (3,)."""
    x, v, a = reference[0], reference[1], reference[2]
    jerk = (a - state[REFERENCE_ACCELERATION]) / dt if state[STARTED] != 0.0 else 0.0
    target = np.empty(3)
    target[0] = x + tau * (v + tau * (a / 2.0 + tau * jerk / 6.0))
    target[1] = v + tau * (a + tau * jerk / 2.0)
    target[2] = a + tau * jerk
    return target


@njit
def step(state, model, settings, rest, reference):  # type: ignore[no-untyped-def]
    """One sample.

    Parameters
    ----------
    state : array from `VirtualTable.initial_state` or the step before; not changed.
    model : the copy's parameters, an array of one record.
    settings : `Settings`.
    rest : (STATES,) the copy at rest at 0 m.
    reference : (3,) position [m], velocity [m/s], acceleration [m/s²] now

    Returns
    -------
    state : new array; its velocity is not finite where the copy diverged.
    u : the command for this sample [-]
    virtual : (3,) position, velocity, acceleration of the copy now; with a lead, of the table after it
    """
    p, limit, dt, lead, most = model[0], settings.limit, settings.sample_time, settings.lead, settings.most
    following = state.copy()
    table = following[HEAD:]
    if state[STARTED] == 0.0:
        table[:STATES] = rest
        table[POSITION] = table[LAGGED_POSITION] = ahead(state, reference, lead, dt)[0]
    virtual = np.empty(3)
    virtual[2] = acceleration_now(p, table, np.zeros(CONTINUOUS))
    virtual[0], virtual[1] = table[POSITION] + table[BASE], table[VELOCITY]
    target = ahead(state, reference, lead + settings.samples * dt, dt)
    before = state[COMMAND]
    least, largest = max(before - most, -limit), min(before + most, limit)
    u = seek(p, table, before, target, settings, least, largest)
    carry(p, table, u, settings, 1, FINE)
    following[STARTED], following[COMMAND], following[REFERENCE_ACCELERATION] = 1.0, u, reference[2]
    return following, u, virtual


@njit
def follow(model, settings, rest, references, commands, virtual):  # type: ignore[no-untyped-def]
    """A whole reference: row k of `virtual` (n, 3) and `commands` (n,) are filled from `references` (n, 3)."""
    state = np.zeros(HEAD + rest.shape[0] + settings.whole + 2)
    for k in range(references.shape[0]):
        state, commands[k], virtual[k] = step(state, model, settings, rest, references[k])


class VirtualTable:
    """The copy of a table and the search for its command; holds no state of its own.

    Parameters
    ----------
    model : the table's parameters; its sensors are not used.
    sample_time : [s]
    bandwidth : ω of the surface [rad/s]
    horizon : H [s]; a dead time of the model is added to it, and the sum rounded to at least one sample.
    limit : largest command [-]
    rate : of the command, at most [1/s]; a short horizon does not bear a low one.
    predict : whether the copy runs ahead by the model's dead time, see above.

    Attributes
    ----------
    record, settings, rest : what the compiled `step` takes.
    """

    def __init__(
        self,
        model: TableParameters,
        sample_time: float,
        bandwidth: float,
        horizon: float,
        limit: float,
        rate: float = math.inf,
        predict: bool = False,
    ) -> None:
        if not (math.isfinite(horizon) and horizon > 0.0):
            raise OutOfBounds(f"model_horizon = {horizon!r} is not a positive number")
        model = model.without(["coupling_backlash"])
        vector = model.vector()
        self.record = FULL_LAYOUT.alone(vector)
        self.rest = initial_state(vector)
        weigh(vector, self.rest)
        lead = model.value(DELAY) if predict else 0.0
        whole, fraction = (0, 0.0) if predict else dead_time(model, sample_time)
        samples = max(whole + 1, round(horizon / sample_time + (whole + fraction)))
        self.settings = Settings(
            whole,
            fraction,
            samples,
            float(bandwidth),
            float(limit),
            float(sample_time),
            float(lead),
            float(rate * sample_time),
        )
        self.size = HEAD + STATES + whole + 2

    def initial_state(self) -> NDArray[np.float64]:
        """Not started; the copy takes its place at the first reference."""
        return np.zeros(self.size)

    def step(
        self, state: NDArray[np.float64], reference: Sequence[float] | NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
        """One sample; arguments and results as of the compiled `step`.

        Raises
        ------
        ShakeError : the virtual table diverged.
        """
        wanted = np.array(reference, dtype=np.float64)
        following, u, virtual = step(state, self.record, self.settings, self.rest, wanted)
        if not math.isfinite(following[HEAD + VELOCITY]):
            raise ShakeError("controller: the virtual table diverged")
        return following, float(u), virtual

    def carry_load(self, rigid: float, swaying: float, pitch: float) -> None:
        """Give the copy another specimen from the next sample on; arguments as of `plant.options.set_load`."""
        set_load(self.record, rigid, swaying, pitch)

    def follow(self, references: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Commands (n,) [-] and motion (n, 3) of the virtual table along a reference (n, 3), as `step` makes them.

        The copy does not see the real table, so both can be computed before a run and serve any law.

        Raises
        ------
        ShakeError : the virtual table diverged.
        """
        commands, virtual = np.empty(len(references)), np.empty((len(references), 3))
        follow(self.record, self.settings, self.rest, np.ascontiguousarray(references), commands, virtual)
        if not np.isfinite(virtual).all():
            raise ShakeError("controller: the virtual table diverged")
        return commands, virtual
