"""Model feedforward from a virtual table: the command under which the identified model follows the reference.

The controller carries a copy of the identified table, the whole compiled plant with every effect that it has, without
noise. At each sample the command is sought which, held over a short horizon, brings the copy onto the surface

    s = e_3 + 2 ω e_2 + ω² e_1 = 0 at t + H,   e = virtual table − reference,

where the reference at t + H is continued from its position, velocity, acceleration and the difference of its last two
accelerations. s rises with the command, so a few secant steps inside a bracket find it, whatever stands between
the command and the table: dead band, null shift, soft zone, play, friction, dead time. No inverse is written by hand.
The copy then takes that command for one sample, and the command is the feedforward of the real table, whose own
feedback has to deal with what the model lacks. Not in the thesis, whose feedforward is α_4 ẋ_ref.

Verified against: a model equal to the plant, which then tracks to within the horizon's error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.plant.integration import ABSOLUTE, STAGES, acceleration_now, advance_sample
from shake_ros.core.plant.parameters import TableParameters, records
from shake_ros.core.plant.simulation import initial_state
from shake_ros.core.plant.states import BASE, CONTINUOUS, POSITION, STATES, VELOCITY
from shake_ros.core.quantities import OutOfBounds, ShakeError

FINE = 1e-4  # relative local error of an integration step of the copy
COARSE = 1e-3  # the same within a prediction
EVALUATIONS = 5  # predictions per sample, at most
NARROW = 1e-4  # [-] command interval at which the search ends
STARTED, COMMAND, REFERENCE_ACCELERATION = range(3)  # of the state, before the copy's states
HEAD = 3


@njit
def carry(p, y, u, whole, fraction, samples, dt, tolerance):  # type: ignore[no-untyped-def]
    """`y` (states, then past commands, newest first) carried in place over samples under a held command u."""
    k = np.zeros((STAGES, CONTINUOUS))
    stage = np.zeros(CONTINUOUS)
    absolute = ABSOLUTE.copy()
    past = y[STATES:]
    acceleration = acceleration_now(p, y, stage)
    for _ in range(samples):
        for i in range(past.shape[0] - 1, 0, -1):
            past[i] = past[i - 1]
        past[0] = u
        acceleration = advance_sample(
            p, y, past[whole + 1], past[whole], fraction, 0.0, dt, k, stage, absolute, tolerance
        )
    return acceleration


@njit
def miss(p, y, u, target, whole, fraction, samples, omega, dt, tolerance):  # type: ignore[no-untyped-def]
    """s at the horizon under a held command u [m/s²]."""
    ahead = y.copy()
    acceleration = carry(p, ahead, u, whole, fraction, samples, dt, tolerance)
    return (
        acceleration
        - target[2]
        + 2.0 * omega * (ahead[VELOCITY] - target[1])
        + omega * omega * (ahead[POSITION] + ahead[BASE] - target[0])
    )


@njit
def seek(p, y, start, target, whole, fraction, samples, omega, limit, dt, tolerance):  # type: ignore[no-untyped-def]
    """The command in ±limit for which `miss` vanishes: secant steps, kept inside the bracket found so far."""
    low, high = -limit, limit
    s_low, s_high = np.nan, np.nan
    u = min(max(start, low), high)
    for count in range(EVALUATIONS):
        s = miss(p, y, u, target, whole, fraction, samples, omega, dt, tolerance)
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
            if guess <= -limit or guess >= limit:
                return min(max(guess, -limit), limit)
        u = guess
    return u


class VirtualTable:
    """The copy of a table and the search for its command; holds no state of its own.

    Parameters
    ----------
    model : the table's parameters; its sensors play no part.
    sample_time : [s]
    bandwidth : ω of the surface [rad/s]
    horizon : H [s], rounded to at least one sample; a dead time of the model is added to it.
    limit : largest command [-]
    """

    def __init__(
        self, model: TableParameters, sample_time: float, bandwidth: float, horizon: float, limit: float
    ) -> None:
        if not (math.isfinite(horizon) and horizon > 0.0):
            raise OutOfBounds(f"model_horizon = {horizon!r} is not a positive number")
        self.sample_time, self.bandwidth, self.limit = sample_time, bandwidth, limit
        self._vector = model.vector()
        self._record = records(self._vector)[0]
        delay = model.value("effects.command_delay.delay") / sample_time
        self._whole, self._fraction = math.floor(delay), delay - math.floor(delay)
        self._samples = max(1, round(horizon / sample_time)) + math.ceil(delay)
        self._rates = np.zeros(CONTINUOUS)

    @property
    def size(self) -> int:
        """Length of the state."""
        return HEAD + STATES + self._whole + 2

    def initial_state(self) -> NDArray[np.float64]:
        """Not started; the copy takes its place at the first reference."""
        return np.zeros(self.size)

    def _ahead(self, state: NDArray[np.float64], reference: Sequence[float]) -> NDArray[np.float64]:
        """The reference continued to the horizon, (3,)."""
        x, v, a = reference
        tau = self._samples * self.sample_time
        jerk = (a - state[REFERENCE_ACCELERATION]) / self.sample_time if state[STARTED] else 0.0
        return np.array(
            [x + tau * (v + tau * (a / 2.0 + tau * jerk / 6.0)), v + tau * (a + tau * jerk / 2.0), a + tau * jerk]
        )

    def step(
        self, state: NDArray[np.float64], reference: Sequence[float]
    ) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
        """One sample.

        Parameters
        ----------
        state : from `initial_state` or the step before; not changed.
        reference : position [m], velocity [m/s], acceleration [m/s²] now

        Returns
        -------
        (state, u, virtual) : new array; the command for this sample [-]; position, velocity and acceleration of the
        virtual table now, (3,)

        Raises
        ------
        ShakeError : the virtual table left the finite numbers.
        """
        following = state.copy()
        table = following[HEAD:]
        if not state[STARTED]:
            table[:STATES] = initial_state(self._vector, float(reference[0]))
        acceleration = acceleration_now(self._record, table, self._rates)
        virtual = np.array([table[POSITION] + table[BASE], table[VELOCITY], acceleration])
        target = self._ahead(state, reference)
        delay = (self._whole, self._fraction)
        u = seek(
            self._record, table, state[COMMAND], target, *delay, self._samples,
            self.bandwidth, self.limit, self.sample_time, COARSE,
        )  # fmt: skip
        acceleration = carry(self._record, table, u, *delay, 1, self.sample_time, FINE)
        if not math.isfinite(acceleration):
            raise ShakeError("controller: the virtual table left the finite numbers")
        following[STARTED], following[COMMAND], following[REFERENCE_ACCELERATION] = 1.0, u, reference[2]
        return following, float(u), virtual
