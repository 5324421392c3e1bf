"""The load that is not known: mass and first mode of the specimen, followed while the table runs.

Each tracker carries the table with a specimen of a rigid mass m_r and a mass m_q on a spring of frequency f, and three
copies beside it in which one of θ = (m_r, m_q, ln f) is a little larger. All are driven by the command and held at the
measured position by a slow correction; what they then say of the acceleration differs from the accelerometer by

    ε = a − â(θ),   ψ = dâ/dθ by the copies,   θ ← θ + P ψ ε / (R + ψᵀ P ψ),   P ← P − P ψ ψᵀ P / (R + ψᵀ P ψ) + Q dt,

the recursive prediction error method (Ljung and Söderström 1983) with a parameter that wanders. Of ε and ψ a band
counts, without the accelerometer's bias and most of its noise. P never exceeds its first value and θ stays within
bounds, so a motion without information changes nothing. ε is bounded, since friction that breaks away elsewhere than in
the model is no mass. The frequency has several valleys: each part of its band has a tracker, and the one leads whose ε²
has been the least of late. One copy more keeps the specimen that the table is known with: the leader is believed only
where its ε² is clearly the smaller of the two, otherwise the known specimen is reported. That load follows smoothly,
so that what is scheduled by it does not jump. Not in the thesis.

Verified against: tables of known specimens, rigid and swaying, and one whose frequency drops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.observer.law import carry_copy, copy_at
from shake_ros.physics.plant.dormand_prince import STAGE, workspace
from shake_ros.physics.plant.integration import acceleration_now, displace
from shake_ros.physics.plant.options import set_load
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters, dead_time, delayed_by
from shake_ros.physics.plant.states import POSITION, VELOCITY
from shake_ros.quantities import Parameters, ShakeError, quantity

Array = NDArray[np.float64]
RIGID, SWAYING, PITCH = range(3)  # places in θ: m_r [kg], m_q [kg], ln f [ln Hz]
UNKNOWNS = 3
STEPS = (0.1, 0.05, 0.05)  # of the copies, over the spreads
BOUND = 3.0  # times the expected error: bound of ε
LEAST = 0.5  # [kg] of m_q, so that the specimen's states are never at rest for good
BETTER = 0.9  # of the leader's ε² that another tracker must fall below to lead
CLEARLY = 0.7  # of the known specimen's ε² that the leader must fall below to be believed


@dataclass(frozen=True)
class LoadTracking(Parameters):
    """How much is expected of the specimen, and how fast it is followed."""

    rigid_spread: float = quantity("kg", "expected departure of the rigid mass from the table's own", low=0.1, high=1e6)
    swaying_spread: float = quantity("kg", "expected size of the mass that sways", low=0.1, high=1e6)
    frequency_spread: float = quantity("-", "expected departure of ln f within a tracker's part", low=1e-3, high=3.0)
    largest: float = quantity("kg", "largest mass of either part", low=1.0, high=1e6)
    lowest: float = quantity("Hz", "lowest frequency of the specimen", low=0.1, high=100.0)
    highest: float = quantity("Hz", "highest frequency of the specimen", low=0.1, high=100.0)
    trackers: int = quantity("-", "trackers, evenly spaced in ln f", low=1, high=32)
    damping: float = quantity("-", "damping ratio of the specimen", low=1e-3, high=1.0)
    error: float = quantity("m/s^2", "acceleration error of a correct model, noise included", low=1e-4, high=10.0)
    correlation: float = quantity("s", "correlation time of that error", low=1e-4, high=10.0)
    following: float = quantity("s", "time in which a parameter may wander by its spread", low=0.01, high=1e4)
    memory: float = quantity("s", "time over which trackers are compared", low=0.01, high=100.0)
    slowest: float = quantity("rad/s", "ε and ψ count above this: bias and drift do not", low=0.1, high=1e3)
    fastest: float = quantity("rad/s", "ε and ψ count below this: noise does not", low=1.0, high=1e4)
    hold: float = quantity("rad/s", "bandwidth at which the copies are held in position", low=0.1, high=100.0)
    smooth: float = quantity(
        "s", "time constant with which the reported load follows the best tracker", low=1e-3, high=100.0
    )


class Fixed(NamedTuple):
    """What the compiled step takes and does not change: numbers of `LoadTracker`."""

    spread: Array  # (3,) first standard deviation of θ
    step: Array  # (3,) by which the copies differ
    low: Array  # (trackers, 3)
    high: Array  # (trackers, 3)
    known: Array  # (3,) θ of the specimen that the table is known with
    whole: int
    fraction: float
    dt: float
    hold: float
    noise: float  # R
    bound: float  # of ε [m/s²]
    wander: float  # share of the spread's square a sample
    fade: float  # of ε² a sample
    below: float  # share of the way that the slow low-pass goes a sample
    within: float  # the same of the two fast ones
    smooth: float  # the same of the reported load


class State(NamedTuple):
    """What a sample changes, in place."""

    theta: Array  # (trackers, 3)
    covariance: Array  # (trackers, 3, 3)
    cost: Array  # (trackers,) mean of ε² of late [m²/s⁴]
    copies: Array  # (trackers, 4, states and past commands)
    passed: Array  # (trackers, 4, 3) low-passes of ε and ψ
    leader: NDArray[np.int64]  # (1,)
    believed: NDArray[np.int64]  # (1,) whether the leader is
    known: Array  # (states and past commands,) the copy with the known specimen
    known_passed: Array  # (3,) low-passes of its ε
    known_cost: Array  # (1,) its mean of ε² of late [m²/s⁴]
    reported: Array  # (3,) reported θ


@njit
def answer(model, y, command, position, fixed, work):  # type: ignore[no-untyped-def]
    """A copy carried over a sample and held at the measured position; its acceleration before that [m/s²]."""
    p = model[0]
    carry_copy(p, y, y.shape[0], command, fixed.whole, fixed.fraction, fixed.dt, work)
    found = acceleration_now(p, y, work[STAGE])
    away = position - y[POSITION]
    displace(y, 2.0 * fixed.hold * fixed.dt * away)
    y[VELOCITY] += fixed.hold * fixed.hold * fixed.dt * away
    return found


@njit
def band(value, passed, fixed):  # type: ignore[no-untyped-def]
    """The part of a signal between the two bounds; `passed` (3,) are the low-passes, changed in place."""
    passed[0] += fixed.below * (value - passed[0])
    passed[1] += fixed.within * (value - passed[0] - passed[1])
    passed[2] += fixed.within * (passed[1] - passed[2])
    return passed[2]


@njit
def learn(theta, covariance, slope, error, low, high, fixed):  # type: ignore[no-untyped-def]
    """θ and P after a sample, in place; `slope` is ψ."""
    gained = covariance @ slope
    size = fixed.noise + slope @ gained
    error = min(max(error, -fixed.bound), fixed.bound)
    for i in range(UNKNOWNS):
        theta[i] = min(max(theta[i] + gained[i] / size * error, low[i]), high[i])
        for j in range(UNKNOWNS):
            covariance[i, j] -= gained[i] * gained[j] / size
    for i in range(UNKNOWNS):
        covariance[i, i] += fixed.wander * fixed.spread[i] ** 2
        over = fixed.spread[i] / math.sqrt(covariance[i, i])
        if over < 1.0:
            covariance[i, :] *= over
            covariance[:, i] *= over


@njit
def faded(cost, error, fixed):  # type: ignore[no-untyped-def]
    """The mean of ε² of late after a sample, of ε within its bound [m²/s⁴]."""
    bounded = min(max(error, -fixed.bound), fixed.bound)
    return fixed.fade * cost + (1.0 - fixed.fade) * bounded * bounded


@njit
def track(state, fixed, model, position, acceleration, command, work):  # type: ignore[no-untyped-def]
    """One sample, in place.

    Parameters
    ----------
    model : the table's record, an array of one; the specimen in it is changed. position [m], acceleration [m/s²] :
        measured now.
    command : held since the sample before [-].
    work : from `law.work`.
    """
    slope = np.empty(UNKNOWNS)
    for k in range(state.theta.shape[0]):
        theta, copies = state.theta[k], state.copies[k]
        set_load(model, theta[RIGID], theta[SWAYING], theta[PITCH])
        own = answer(model, copies[UNKNOWNS], command, position, fixed, work)
        for i in range(UNKNOWNS):
            moved = theta.copy()
            moved[i] += fixed.step[i]
            set_load(model, moved[RIGID], moved[SWAYING], moved[PITCH])
            away = answer(model, copies[i], command, position, fixed, work) - own
            slope[i] = band(away / fixed.step[i], state.passed[k, i], fixed)
        error = band(acceleration - own, state.passed[k, UNKNOWNS], fixed)
        state.cost[k] = faded(state.cost[k], error, fixed)
        if math.isfinite(error + slope[0] + slope[1] + slope[2]):
            learn(theta, state.covariance[k], slope, error, fixed.low[k], fixed.high[k], fixed)
        else:
            state.cost[k] = math.inf
    best = np.argmin(state.cost)
    if state.cost[best] < BETTER * state.cost[state.leader[0]]:
        state.leader[0] = best
    set_load(model, fixed.known[RIGID], fixed.known[SWAYING], fixed.known[PITCH])
    own = answer(model, state.known, command, position, fixed, work)
    state.known_cost[0] = faded(state.known_cost[0], band(acceleration - own, state.known_passed, fixed), fixed)
    state.believed[0] = state.cost[state.leader[0]] < CLEARLY * state.known_cost[0]
    aim = state.theta[state.leader[0]] if state.believed[0] else fixed.known
    for i in range(UNKNOWNS):
        state.reported[i] += fixed.smooth * (aim[i] - state.reported[i])


@njit
def track_run(state, fixed, model, positions, accelerations, commands, work, reported):  # type: ignore[no-untyped-def]
    """A whole recording, (n,) each; command k is held from sample k to the next. It fills `reported` (n, 3)."""
    for k in range(positions.shape[0]):
        command = commands[k - 1] if k > 0 else 0.0
        track(state, fixed, model, positions[k], accelerations[k], command, work)
        reported[k] = state.reported


class LoadTracker:
    """The trackers of a table; holds no state of its own.

    Parameters
    ----------
    table : as it is known, with the specimen from which the search starts.
    sample_time : [s]
    loop_delay : dead time beyond the table's [s].
    """

    def __init__(
        self, parameters: LoadTracking, table: TableParameters, sample_time: float, loop_delay: float = 0.0
    ) -> None:
        p, dt = parameters, sample_time
        self.parameters, self.table = p, delayed_by(table, loop_delay)
        self.model = FULL_LAYOUT.alone(
            self.table.with_values({"effects.specimen_resonance.damping": p.damping}).vector()
        )
        spread = np.array([p.rigid_spread, p.swaying_spread, p.frequency_spread])
        low, high = np.zeros((p.trackers, UNKNOWNS)), np.full((p.trackers, UNKNOWNS), p.largest)
        edges = np.linspace(math.log(p.lowest), math.log(p.highest), p.trackers + 1)
        low[:, SWAYING], low[:, PITCH], high[:, PITCH] = LEAST, edges[:-1], edges[1:]
        whole, fraction = dead_time(self.table, dt)
        self.fixed = Fixed(
            spread=spread,
            step=spread * STEPS,
            low=low,
            high=high,
            known=self._known(),
            whole=int(whole),
            fraction=float(fraction),
            dt=dt,
            hold=p.hold,
            noise=p.error**2 * max(p.correlation / dt, 1.0),
            bound=BOUND * p.error,
            wander=dt / p.following,
            fade=math.exp(-dt / p.memory),
            below=-math.expm1(-p.slowest * dt),
            within=-math.expm1(-p.fastest * dt),
            smooth=-math.expm1(-dt / p.smooth),
        )

    def _known(self) -> Array:
        """θ of the table's own specimen."""
        swaying = self.table.value("effects.specimen_resonance.mass")
        rigid = self.table.value("body.specimen_mass") - swaying
        return np.array(
            [rigid, max(swaying, LEAST), math.log(self.table.value("effects.specimen_resonance.frequency"))]
        )

    def initial_state(self, position: float = 0.0) -> State:
        """Trackers at rest at a position [m], their frequencies evenly spaced in ln f."""
        n = self.parameters.trackers
        theta = np.empty((n, UNKNOWNS))
        theta[:, RIGID] = self.table.value("body.specimen_mass")
        theta[:, SWAYING] = LEAST
        theta[:, PITCH] = 0.5 * (self.fixed.low[:, PITCH] + self.fixed.high[:, PITCH])
        one = copy_at(np.array([position, 0.0, 0.0]), self.table, self.fixed.dt, 0.0)
        covariance = np.tile(np.diag(self.fixed.spread**2), (n, 1, 1))
        copies = np.tile(one, (n, UNKNOWNS + 1, 1))
        passed, leader = np.zeros((n, UNKNOWNS + 1, 3)), np.zeros(1, dtype=np.int64)
        reported = self.fixed.known.copy()
        return State(
            theta, covariance, np.zeros(n), copies, passed, leader, np.zeros(1, dtype=np.int64), one.copy(),
            np.zeros(3), np.zeros(1), reported,
        )  # fmt: skip

    def run(self, positions: Array, accelerations: Array, commands: Array) -> tuple[Array, Array]:
        """The load over a recording, from rest.

        Parameters
        ----------
        positions, accelerations, commands : (n,) [m], [m/s²], [-]; command k is held from sample k to the next.

        Returns
        -------
        (loads, errors) : (n, 3) rigid mass [kg], swaying mass [kg], frequency [Hz] as reported, and the standard
            errors (3,) of the leader at the end.

        Raises
        ------
        ShakeError : series of different lengths, or with a value that is not finite.
        """
        given = [np.ascontiguousarray(series, dtype=np.float64) for series in (positions, accelerations, commands)]
        if not given[0].size or any(series.shape != (given[0].size,) for series in given):
            raise ShakeError(f"load: series of shapes {', '.join(str(series.shape) for series in given)}")
        if not all(np.isfinite(series).all() for series in given):
            raise ShakeError("load: a position, acceleration or command is not finite")
        state, reported = self.initial_state(float(given[0][0])), np.empty((given[0].size, UNKNOWNS))
        track_run(state, self.fixed, self.model.copy(), *given, workspace(), reported)
        reported[:, PITCH] = np.exp(reported[:, PITCH])
        errors = np.sqrt(np.diag(state.covariance[state.leader[0]])) * [1.0, 1.0, reported[-1, PITCH]]
        return reported, np.asarray(errors)
