"""A run of the closed loop in compiled code, many side by side on all cores; its errors and cost; gains tuned on it.

Plant, sensors, observer, controller and reference are one compiled function, with the same semantics and the same
numbers as the graph in lock-step: measurement k, estimate k from it and command k − 1, command k from estimate k and
reference k, then the plant advances under command k. The virtual table of a model feedforward does not see the real
table; it runs along the reference once and serves every law (`VirtualTable.follow`).

`tune` minimises the functional (6.42) over several tables.

The thesis minimises J = ∫ (x − x_ref)² + (ẋ − ẋ_ref)² dt on one model. Here each case (a table, an observer, a
reference, a delay) gives its J; their mean over the loads and the worst over perturbed tables are minimised together,
so that gains are not fitted to one table. The travel of the command is priced, because J does not see what noise does
to a valve.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from shake_ros.compiled import njit
from shake_ros.control.laws import harmonic_cancellation
from shake_ros.control.laws.harmonic_cancellation import HarmonicCancellation
from shake_ros.control.laws.runner import Controller, own_feedforward, step_controller
from shake_ros.control.observer.runner import NO_MODEL, NO_OBSERVER, Compiled, Observer, step_observer, work
from shake_ros.packing import fields_layout, numbers
from shake_ros.physics.plant.dormand_prince import STAGE, workspace
from shake_ros.physics.plant.integration import OUTPUTS, acceleration_now, advance_late, outputs
from shake_ros.physics.plant.parameters import TableParameters, dead_time, records
from shake_ros.physics.plant.sensors import normal_draws
from shake_ros.physics.plant.simulation import TOLERANCE, workers
from shake_ros.physics.plant.states import BASE, BASE_RATE, POSITION, STATES, VELOCITY
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import ShakeError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClosedLoop:
    """A run; row k belongs to t_k. `reference`, `estimate`, `truth`: (n, 3) position [m], velocity, acceleration.

    `command`: (n,) [-]. `measured`: (n, 5) position [m], acceleration [m/s²], P_A, P_B, P_s [Pa].
    """

    sample_time: float
    reference: Array
    estimate: Array
    truth: Array
    command: Array
    measured: Array

    def after(self, seconds: float) -> ClosedLoop:
        """The run from an instant on [s]."""
        first = round(seconds / self.sample_time)
        rows = self.reference, self.estimate, self.truth, self.command, self.measured
        return ClosedLoop(self.sample_time, *(row[first:] for row in rows))

    def tracking_error(self, first: int = 0) -> Array:
        """(3,) rms(truth − reference)/rms(reference − mean) of position, velocity, acceleration from a sample on."""
        return normalised_error(self.reference[first:], self.truth[first:])


def normalised_error(wanted: Array, found: Array) -> Array:
    """Root mean square of found − wanted over that of wanted − its mean, column by column.

    >>> normalised_error(np.array([[1.0], [-1.0]]), np.array([[1.1], [-1.1]])).round(6).tolist()
    [0.1]
    """
    error: Array = np.sqrt(
        np.mean((found - wanted) ** 2, axis=0) / np.mean((wanted - wanted.mean(axis=0)) ** 2, axis=0)
    )
    return error


LOST = 10.0  # cost of a loop that did not hold
SPREAD = 0.5  # of the first simplex, in the logarithm of a gain


def tracking_cost(run: ClosedLoop, position_weight: float = 1.0) -> float:
    """J of (6.42), ∫ w² (x − x_ref)² + (ẋ − ẋ_ref)² dt [m²/s], by the rectangle rule.

    The print adds squares of metres to squares of metres a second, that is w = 1/s, under which the position hardly
    counts in motions of some hertz.

    Parameters
    ----------
    position_weight : w [1/s]
    """
    error = run.truth[:, :2] - run.reference[:, :2]
    return float(np.sum((error * (position_weight, 1.0)) ** 2) * run.sample_time)


def command_travel(run: ClosedLoop) -> float:
    """Mean travel of the command per second [1/s]."""
    return float(np.mean(np.abs(np.diff(run.command))) / run.sample_time)


def normalised_cost(
    run: ClosedLoop, travel_price: float, position_weight: float = 1.0, acceleration_price: float = 0.0
) -> float:
    """√(J/J_0) + price × travel + price × acceleration error; J_0 is the J of a table that stands still [-].

    An oil column that rings hardly shows in position and velocity, so (6.42) alone does not keep it quiet.

    Parameters
    ----------
    travel_price : [s].
    position_weight : as in `tracking_cost`.
    acceleration_price : of the normalised rms error [-].
    """
    away = (run.reference[:, :2] - run.reference[0, :2]) * (position_weight, 1.0)
    still = float(np.sum(away**2) * run.sample_time)
    cost = math.sqrt(tracking_cost(run, position_weight) / still) + travel_price * command_travel(run)
    if acceleration_price > 0.0:
        cost += acceleration_price * float(normalised_error(run.reference, run.truth)[2])
    return cost


def mean_and_worst(loads: Sequence[float], tables: Sequence[float], robustness: float) -> float:
    """Mean cost over the loads plus a weight times the worst cost over perturbed tables, 0 where there are none.

    >>> mean_and_worst([0.1, 0.3], [0.2, 0.4], 0.5)
    0.4
    """
    return math.fsum(loads) / len(loads) + (robustness * max(tables) if tables else 0.0)


def tune(
    start: Mapping[str, float],
    cost: Callable[[dict[str, float]], float],
    *,
    evaluations: int,
    done: Callable[[int, float], None] = lambda *_: None,
) -> tuple[dict[str, float], float]:
    """Gains that minimise a cost, by Nelder and Mead on the logarithms of their magnitudes.

    Parameters
    ----------
    start : gains by name, none of them zero; signs are kept.
    cost : of a set of gains; a ShakeError (a gain out of its bounds, a lost loop) and NaN count as LOST.
    evaluations : largest number of evaluations.
    done : called with the number of evaluations and the lowest cost.

    Returns
    -------
    (gains, cost) : the best of all that were tried.
    """
    names = list(start)
    signs = np.sign([start[n] for n in names])
    if not names or not np.all(signs):
        raise ShakeError(f"tuning: a gain of zero cannot be tuned: {[n for n in names if start[n] == 0.0]}")
    best: tuple[float, dict[str, float]] = (math.inf, dict(start))
    count = 0

    def gains(point: np.ndarray) -> dict[str, float]:
        return {n: float(s * math.exp(x)) for n, s, x in zip(names, signs, point, strict=True)}

    def tried(point: np.ndarray) -> float:
        nonlocal best, count
        wanted = gains(point)
        try:
            found = cost(wanted)
        except ShakeError:
            found = LOST
        found = found if math.isfinite(found) else LOST
        if found < best[0]:
            best = (found, wanted)
        count += 1
        done(count, best[0])
        return found

    first = np.log(np.abs([start[n] for n in names]))
    simplex = np.vstack([first, first + SPREAD * np.eye(len(names))])
    options = {"initial_simplex": simplex, "maxfev": evaluations, "fatol": 1e-5, "adaptive": len(names) > 3}
    minimize(tried, first, method="Nelder-Mead", options=options)
    return best[1], best[0]


Result = TypeVar("Result")
MEASURED = 5  # columns of `measured`: position, acceleration, P_A, P_B, P_s
NOTHING = np.zeros(0)
NO_MOTION = np.zeros((0, 3))
NO_CANCELLATION = np.zeros(1, fields_layout(HarmonicCancellation))


@njit
def read_sensors(p, noise, shown, measured):  # type: ignore[no-untyped-def]
    """Noise and the position converter's steps and range on what the sensors see, as `plant.sensors.SensorNoise`.

    Parameters
    ----------
    p : parameter record.
    noise : (5,) standard normal draws.
    shown : (OUTPUTS,) row of `integration.outputs`.
    measured : (5,) result, position [m], acceleration [m/s²], P_A, P_B, P_s [Pa]
    """
    position = shown[0] + p.sensors_position_noise * noise[0]
    if p.sensors_position_bits > 0.0:
        step = p.sensors_position_range / 2.0**p.sensors_position_bits
        position = np.rint(position / step) * step
    half = 0.5 * p.sensors_position_range
    measured[0] = min(max(position, -half), half)
    measured[1] = shown[2] + p.sensors_acceleration_noise * noise[1]
    for i in range(3):
        measured[2 + i] = shown[3 + i] + p.sensors_pressure_noise * noise[2 + i]


@njit
def run_loop(p, plant, observer, seen, law, state, reference, feedforward, added, timing, noise, space, out):  # type: ignore[no-untyped-def]
    """One closed loop, sample by sample.

    Parameters
    ----------
    p : parameter record of the plant.
    plant : its first state with the past commands behind it; changed in place.
    observer : `Observer.compiled`; `NO_OBSERVER` gives the controller the true states.
    seen : the observer's first state, changed in place.
    law : `Controller.law`.
    state : the controller's first state.
    reference : (n, 3).
    feedforward : commands (n,) and motion (n, 3) of a virtual table, or both empty.
    added : harmonics' first state, empty without them, and numbers of a harmonic cancellation.
    timing : (dt [s], delay of the command in samples, whole samples and fraction of the plant's own dead time)
    noise : (n, 5) standard normal draws.
    space : from `observer.law.work`.
    out : estimate (n, 3), truth (n, 3), command (n,), measured (n, 5)

    Returns
    -------
    number of samples before a value was not finite, n where none was.
    """
    observing, model = observer
    commands, motion = feedforward
    harmonics, cancelling = added
    dt, delay, whole, fraction = timing
    estimate, truth, command, measured = out
    work, shown, past = workspace(), np.zeros(OUTPUTS), plant[STATES:]
    u = 0.0
    for k in range(reference.shape[0]):
        acceleration = acceleration_now(p, plant, work[STAGE])
        outputs(p, plant, acceleration, shown)
        read_sensors(p, noise[k], shown, measured[k])
        truth[k, 0] = plant[POSITION] + plant[BASE]
        truth[k, 1] = plant[VELOCITY] + plant[BASE_RATE]
        truth[k, 2] = acceleration
        if observing[0].kind == 0.0:
            estimate[k] = truth[k]
        else:
            step_observer(seen, observing, model, measured[k], u, dt, space, estimate[k])
        if not math.isfinite(estimate[k, 0] + estimate[k, 1] + estimate[k, 2]):
            return k
        if commands.shape[0] > 0:
            state, u = step_controller(state, law, motion[k], estimate[k], commands[k], dt)
        else:
            wanted = reference[k]
            if harmonics.shape[0] > 0:
                harmonics, wanted = harmonic_cancellation.step(harmonics, cancelling, k * dt, wanted, measured[k, 1])
            own = own_feedforward(law, wanted)
            state, u = step_controller(state, law, wanted, estimate[k], own, dt)
        command[k] = u
        acting = min(max(command[k - delay] if k >= delay else 0.0, -1.0), 1.0)
        advance_late(p, plant, past, acting, whole, fraction, 0.0, dt, work, k > 0, TOLERANCE)
        if not math.isfinite(plant[VELOCITY] + plant[POSITION] + u):
            return k
    return reference.shape[0]


@dataclass(frozen=True)
class Loop:
    """A closed loop to be run."""

    table: TableParameters  # the plant with its sensors
    observer: Observer | None  # estimates from the measured position; None hands the true states to the controller
    controller: Controller  # the law
    reference: Array  # (n, 3) position [m], velocity [m/s], acceleration [m/s²]
    # commands (n,) and motion (n, 3) of the controller's virtual table along this reference; None, with a controller
    # that has one, computes them
    feedforward: tuple[Array, Array] | None = None
    seed: int = 0  # of the sensor noise
    delay: int = 0  # samples by which a command reaches the valve late
    start: float = 0.0  # initial position of the table [m]
    cancellation: HarmonicCancellation | None = None  # of harmonics, under a law without a virtual table


def simulate(loop: Loop) -> tuple[ClosedLoop, int]:
    """Run a loop in compiled code.

    Returns
    -------
    (run, samples) : the run, and the number of its samples that are finite; the rows behind them are NaN.

    Raises
    ------
    ShakeError : sample times differ, the feedforward is of another length than the reference, or harmonics are to be
        cancelled under a virtual table.
    """
    dt, n = loop.controller.sample_time, len(loop.reference)
    if loop.observer is not None and loop.observer.sample_time != dt:
        raise ShakeError(f"closed loop: sample times {loop.observer.sample_time:g} and {dt:g} s differ")
    reference = np.ascontiguousarray(loop.reference, dtype=np.float64)
    feedforward = loop.feedforward
    if feedforward is None:
        virtual = loop.controller.virtual
        feedforward = (NOTHING, NO_MOTION) if virtual is None else virtual.follow(reference)
    elif len(feedforward[0]) != n or feedforward[1].shape != (n, 3):
        raise ShakeError(f"closed loop: feedforward of {len(feedforward[0])} samples for a reference of {n}")
    added = NOTHING, NO_CANCELLATION
    if loop.cancellation is not None:
        if len(feedforward[0]):
            raise ShakeError("closed loop: harmonics are not cancelled under a virtual table")
        cancellation = loop.cancellation
        added = harmonic_cancellation.initial_state(cancellation), numbers(cancellation)
    out = np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.full(n, np.nan), np.full((n, MEASURED), np.nan)
    table = Table(loop.table, dt, loop.seed)
    plant = table.initial_state(loop.start)
    observer, seen = Compiled(NO_OBSERVER, NO_MODEL), np.zeros(0)
    if loop.observer is not None:
        observer, seen = loop.observer.compiled, loop.observer.initial_state(table.measure(plant, 0).position)
    finite = run_loop(
        records(loop.table.vector())[0],
        plant,
        tuple(observer),
        seen,
        loop.controller.law,
        loop.controller.initial_state()[: loop.controller.law_size],
        reference,
        feedforward,
        added,
        (dt, loop.delay, *dead_time(loop.table, dt)),
        normal_draws(loop.seed, n),
        work(),
        out,
    )
    estimate, truth, command, measured = out
    for rows in out:
        rows[finite:] = np.nan
    return ClosedLoop(dt, reference, estimate, truth, command, measured), finite


def run_batch(
    loops: Sequence[Loop], judge: Callable[[int, ClosedLoop], Result], done: Callable[[int], None] = lambda _: None
) -> list[Result]:
    """Run many loops on all cores without the GIL; `judge(i, run)` keeps of a run what is wanted.

    `done` is called with the number of finished loops, from the calling thread.
    """
    result: list[Result] = []
    with ThreadPoolExecutor(workers()) as pool:
        for value in pool.map(lambda i: judge(i, simulate(loops[i])[0]), range(len(loops))):
            result.append(value)
            done(len(result))
    return result
