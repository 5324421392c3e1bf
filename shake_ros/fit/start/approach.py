"""A fit that begins with predictor runs: simulations corrected towards the measurement, whose error is nearly linear.

A free run keeps every error of phase of the oil column and every late crossing of a threshold, so its sum of squares is
a maze of narrow valleys in which Gauss-Newton steps take off some per cent each. A run that is corrected by what the
sensors show beyond it (`inject` in plant/integration.py), as an observer is, forgets such errors within 1/INJECTION;
its prediction error leads to the neighbourhood of the solution in a few steps. The free run has the last word: the end
of that way is a start, taken where the free run is better there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit, Problem, fit

INJECTION = 40.0  # [1/s] slow beside the oil column, fast beside the time over which a free run loses its phase
EVALUATIONS, TOLERANCE = 12, 1e-3  # of a fit of predictor runs, at most and at least


class PredictorProblem(Problem, Protocol):
    """A problem whose runs may be corrected towards the measurement at a rate [1/s]; 0 for free runs."""

    def predictor(self, injection: float) -> Problem:
        """The same problem with predictor runs; itself where its runs cannot be corrected."""


def approached(
    problem: PredictorProblem,
    free: FreeParameters,
    start: np.ndarray,
    *,
    evaluations: int = 40,
    tolerance: float = 1e-4,
    near: float = 0.0,
) -> Fit:
    """`fit` to free runs from the better of `start` and where a fit of predictor runs leads from there.

    near : mean square of the residuals at which the start is near the end, and no way to it is needed.
    """
    way = predictor_start(problem, free, start, evaluations=evaluations, tolerance=tolerance, near=near)
    return arrived(problem, free, way, evaluations=evaluations, tolerance=tolerance)


@dataclass(frozen=True)
class Approach:
    """The way to a fit of free runs. start : where it begins. predictor : the fit of predictor runs, if any."""

    start: np.ndarray
    predictor: Fit | None = None

    @property
    def predictor_cost(self) -> float:
        """Half the sum of squares that predictor runs leave; 0 without a predictor."""
        return self.predictor.cost if self.predictor is not None else 0.0


def predictor_start(
    problem: PredictorProblem,
    free: FreeParameters,
    start: np.ndarray,
    *,
    evaluations: int = 40,
    tolerance: float = 1e-4,
    near: float = 0.0,
) -> Approach:
    """The first part of `approached`: where a fit of predictor runs leads, if the free run is better there."""
    predictor = problem.predictor(INJECTION)
    if predictor is problem or (begun := _cost(problem, free, start)) <= near:
        return Approach(start)
    most, least = min(EVALUATIONS, evaluations), max(TOLERANCE, tolerance)
    way = fit(predictor, free, start, evaluations=most, tolerance=least)
    return Approach(way.x if _cost(problem, free, way.x) < begun else start, way)


def arrived(
    problem: PredictorProblem, free: FreeParameters, way: Approach, *, evaluations: int = 40, tolerance: float = 1e-4
) -> Fit:
    """The second part of `approached`: the fit of free runs."""
    result = fit(problem, free, way.start, evaluations=evaluations, tolerance=tolerance)
    return result if way.predictor is None else result.after(way.predictor.evaluations + 2)


def _cost(problem: Problem, free: FreeParameters, x: np.ndarray) -> float:
    """Mean square of the residuals; inf where the run ends in no number."""
    return float(np.nan_to_num(np.mean(problem.residuals(free.vectors(x))[0] ** 2), nan=np.inf))
