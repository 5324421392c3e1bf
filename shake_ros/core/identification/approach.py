"""A fit that begins with drawn runs: simulations corrected towards the measurement, whose error is nearly linear.

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

from shake_ros.core.identification.fit import Fit, Problem, fit
from shake_ros.core.identification.free_parameters import FreeParameters

INJECTION = 40.0  # [1/s] slow beside the oil column, fast beside the time over which a free run loses its phase
EVALUATIONS, TOLERANCE = 12, 1e-3  # of a fit of drawn runs, at most and at least


class DrawableProblem(Problem, Protocol):
    """A problem whose runs may be drawn towards the measurement at a rate [1/s]; 0 for free runs."""

    def drawn(self, injection: float) -> Problem:
        """The same problem with drawn runs; itself where its runs cannot be drawn."""


def approached(
    problem: DrawableProblem,
    free: FreeParameters,
    start: np.ndarray,
    *,
    evaluations: int = 40,
    tolerance: float = 1e-4,
    near: float = 0.0,
) -> Fit:
    """`fit` to free runs from the better of `start` and where a fit of drawn runs leads from there.

    near : mean square of the residuals at which the start is near the end, and no way to it is needed.
    """
    way = led(problem, free, start, evaluations=evaluations, tolerance=tolerance, near=near)
    return arrived(problem, free, way, evaluations=evaluations, tolerance=tolerance)


@dataclass(frozen=True)
class Approach:
    """The way to a fit of free runs. start : where it begins. drawn : the fit of drawn runs, where one was made."""

    start: np.ndarray
    drawn: Fit | None = None

    @property
    def drawn_cost(self) -> float:
        """Half the sum of squares that drawn runs leave; 0 where no run was drawn."""
        return self.drawn.cost if self.drawn is not None else 0.0


def led(
    problem: DrawableProblem,
    free: FreeParameters,
    start: np.ndarray,
    *,
    evaluations: int = 40,
    tolerance: float = 1e-4,
    near: float = 0.0,
) -> Approach:
    """The first part of `approached`: where a fit of drawn runs leads from `start`, if the free run is better there."""
    drawn = problem.drawn(INJECTION)
    if drawn is problem or (begun := _cost(problem, free, start)) <= near:
        return Approach(start)
    most, least = min(EVALUATIONS, evaluations), max(TOLERANCE, tolerance)
    way = fit(drawn, free, start, evaluations=most, tolerance=least)
    return Approach(way.x if _cost(problem, free, way.x) < begun else start, way)


def arrived(
    problem: DrawableProblem, free: FreeParameters, way: Approach, *, evaluations: int = 40, tolerance: float = 1e-4
) -> Fit:
    """The second part of `approached`: the fit of free runs."""
    result = fit(problem, free, way.start, evaluations=evaluations, tolerance=tolerance)
    return result if way.drawn is None else result.after(way.drawn.evaluations + 2)


def _cost(problem: Problem, free: FreeParameters, x: np.ndarray) -> float:
    """Mean square of the residuals; inf where the run ends in no number."""
    return float(np.nan_to_num(np.mean(problem.residuals(free.vectors(x))[0] ** 2), nan=np.inf))
