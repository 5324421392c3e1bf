"""Tuning of a controller's gains on the closed loop: the functional (6.42) over several tables, minimised.

The thesis minimises J = ∫ (x − x_ref)² + (ẋ − ẋ_ref)² dt on one model. Here each case (a table with one effect, an
observer, a reference, a delay) gives its J, and the sum over cases is minimised, so that gains are not fitted to one
table; the travel of the command is priced, because J does not see what noise does to a valve.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import minimize

from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.quantities import ShakeError


def tracking_cost(run: ClosedLoop) -> float:
    """J of (6.42) [m²·s, the velocity's square weighted by 1 s²], by the rectangle rule."""
    error = run.truth[:, :2] - run.reference[:, :2]
    return float(np.sum(error**2) * run.sample_time)


def command_travel(run: ClosedLoop) -> float:
    """Mean travel of the command per second [1/s]."""
    return float(np.mean(np.abs(np.diff(run.command))) / run.sample_time)


def normalised_cost(run: ClosedLoop, travel_price: float) -> float:
    """√(J/J_0) + price × travel; J_0 is the J of a table that stands still [-].

    Parameters
    ----------
    travel_price : [s]
    """
    still = float(np.sum((run.reference[:, :2] - run.reference[0, :2]) ** 2) * run.sample_time)
    return math.sqrt(tracking_cost(run) / still) + travel_price * command_travel(run)


def tune(
    start: Mapping[str, float],
    cases: Sequence[Callable[[dict[str, float]], ClosedLoop]],
    *,
    travel_price: float,
    evaluations: int,
) -> tuple[dict[str, float], float]:
    """Gains that minimise the mean cost over the cases, by Nelder and Mead on the logarithms of their magnitudes.

    Parameters
    ----------
    start : gains by name, none of them zero; signs are kept.
    cases : functions of the gains that run a closed loop; a ShakeError counts as a cost of 10.
    travel_price : as in `normalised_cost`.
    evaluations : largest number of evaluations of all cases.

    Returns
    -------
    (gains, cost)
    """
    names = list(start)
    signs = np.sign([start[n] for n in names])
    if not np.all(signs):
        raise ShakeError(f"tuning: a gain of zero cannot be tuned: {[n for n in names if start[n] == 0.0]}")

    def gains(point: np.ndarray) -> dict[str, float]:
        return {n: float(s * math.exp(x)) for n, s, x in zip(names, signs, point, strict=True)}

    def cost(point: np.ndarray) -> float:
        total = 0.0
        for case in cases:
            try:
                total += normalised_cost(case(gains(point)), travel_price)
            except ShakeError:
                total += 10.0
        return total / len(cases)

    first = np.log(np.abs([start[n] for n in names]))
    simplex = np.vstack([first, first + 0.5 * np.eye(len(names))])
    found = minimize(
        cost, first, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": evaluations, "fatol": 1e-5}
    )
    return gains(found.x), float(found.fun)
