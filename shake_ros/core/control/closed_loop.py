"""The closed loop in one process: plant, observer, controller and reference, sample by sample; gains tuned on it.

The same semantics as the lock-step graph: measurement k, estimate k from it and command k − 1, command k from
estimate k and reference k, then the plant advances under command k. A run equals that of the nodes, sample for sample.

`tune` minimises the functional (6.42) over several tables.

The thesis minimises J = ∫ (x − x_ref)² + (ẋ − ẋ_ref)² dt on one model. Here each case (a table, an observer, a
reference, a delay) gives its J; their mean over the loads and the worst over perturbed tables are minimised together,
so that gains are not fitted to one table. The travel of the command is priced, because J does not see what noise does
to a valve.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from shake_ros.core.control.runner import Controller
from shake_ros.core.plant.table import Table
from shake_ros.core.quantities import ShakeError

Array = NDArray[np.float64]


class Estimator(Protocol):
    """What the loop needs of an observer (`core.observer.runner.Observer`)."""

    def initial_state(self, position: float) -> Array: ...

    def step(
        self, state: Array, measured_position: float, u_previous: float, others: Sequence[float]
    ) -> tuple[Array, Any]: ...


class Schedule(Protocol):
    """What the loop needs of a reference (`core.reference.program.Program`)."""

    def at(self, k: int) -> tuple[float, float, float]: ...


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


def simulate_closed_loop(
    table: Table,
    observer: Estimator | None,
    controller: Controller,
    program: Schedule,
    samples: int,
    *,
    delay: int = 0,
    start: float = 0.0,
) -> ClosedLoop:
    """Run the loop.

    Parameters
    ----------
    table : the plant, with its sensors.
    observer : estimates from the sensors that it takes; None hands the true states to the controller.
    controller, program : the law and what it follows.
    samples : length of the run.
    delay : samples by which a command reaches the valve late, as in a real-time loop without lock-step.
    start : initial position of the table [m].

    Raises
    ------
    ShakeError : sample times differ, or a value of the loop is not finite.
    """
    for part in (observer, program):
        other = getattr(part, "sample_time", controller.sample_time)
        if other != controller.sample_time:
            raise ShakeError(f"closed loop: sample times {other:g} and {controller.sample_time:g} s differ")
    if table.sample_time != controller.sample_time:
        raise ShakeError(f"closed loop: sample times {table.sample_time:g} and {controller.sample_time:g} s differ")
    reference, estimate, truth = np.empty((samples, 3)), np.empty((samples, 3)), np.empty((samples, 3))
    command, measured = np.zeros(samples), np.empty((samples, 5))
    plant, law, estimator = table.initial_state(start), controller.initial_state(), np.zeros(0)
    u, waiting = 0.0, [0.0] * delay
    for k in range(samples):
        m = table.measure(plant, k)
        measured[k] = m.position, m.acceleration, m.pressure_a, m.pressure_b, m.pressure_supply
        truth[k] = m.truth_position, m.truth_velocity, m.truth_acceleration
        if observer is None:
            estimate[k] = truth[k]
        else:
            if k == 0:
                estimator = observer.initial_state(m.position)
            others = m.acceleration, m.pressure_a, m.pressure_b
            estimator, estimate[k] = observer.step(estimator, m.position, u, others)
        reference[k] = program.at(k)
        law, u = controller.step(law, reference[k], estimate[k])
        command[k] = u
        waiting.append(u)
        plant = table.advance(plant, waiting.pop(0))
    return ClosedLoop(controller.sample_time, reference, estimate, truth, command, measured)


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
