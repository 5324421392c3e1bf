"""A run of the closed loop: its errors and its cost; gains tuned on it.

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

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

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
