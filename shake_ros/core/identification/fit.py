"""Least-squares fit of free parameters: trust-region reflective with bounds, Jacobian from batched simulations.

The problem gives weighted residuals for many parameter sets at once (so that all cores work); differences are forward,
inward at a bound, with a step of a small part of each parameter's scale. Loss (4.1), Gauss–Newton normal matrix (4.10).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.optimize import least_squares

from shake_ros.core.identification.free_parameters import FreeParameters

DIFFERENCE = 2e-3  # difference step as a part of a parameter's scale or of its value, whichever is larger
Progress = Callable[[str], None]


class Problem(Protocol):
    """What a fit needs: weighted residuals for rows of parameter vectors, shape (m, len(NAMES)) → (m, n)."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals, one row per parameter vector."""


@dataclass(frozen=True)
class Fit:
    """Result of a fit. x : solution in units of the scales, shape (p,). residuals : shape (n,).

    jacobian : shape (n, p), per unit of x. cost : Σ r²/2. evaluations : simulated parameter sets.
    """

    free: FreeParameters
    x: np.ndarray
    residuals: np.ndarray
    jacobian: np.ndarray
    cost: float
    evaluations: int

    @property
    def vector(self) -> np.ndarray:
        """All parameters of the table that was fitted."""
        return np.asarray(self.free.vectors(self.x)[0])

    def after(self, evaluations: int) -> Fit:
        """The same, as the end of so many evaluations more."""
        return replace(self, evaluations=self.evaluations + evaluations)

    def __post_init__(self) -> None:
        if self.x.shape != (len(self.free.names),):
            raise ValueError(f"x of shape {self.x.shape} for {len(self.free.names)} free parameters")


def jacobian(problem: Problem, free: FreeParameters, x: np.ndarray, residuals: np.ndarray) -> np.ndarray:
    """Forward differences of the residuals in one batch, shape (n, p)."""
    step = DIFFERENCE * np.maximum(1.0, np.abs(x))
    step = np.where(x + step > free.high, -step, step)
    moved = problem.residuals(free.vectors(x + np.diag(step)))
    return (moved - residuals).T / step


def fit(
    problem: Problem, free: FreeParameters, start: np.ndarray, *, evaluations: int = 40, tolerance: float = 1e-4
) -> Fit:
    """Minimise Σ r²/2 from `start` (in units of the scales).

    Parameters
    ----------
    evaluations : most trial points. tolerance : relative change of the cost and of x at which it stops.
    """
    count = 0
    last: dict[bytes, np.ndarray] = {}

    def residuals(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        key = x.tobytes()
        if key not in last:
            r = problem.residuals(free.vectors(x))[0]
            last.clear()
            last[key] = np.where(np.isfinite(r), r, 1e6)
        return last[key]

    def derivative(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += len(x)
        j = jacobian(problem, free, x, residuals(x))
        return np.where(np.isfinite(j), j, 0.0)

    margin = 1e-9 * np.maximum(1.0, np.abs(free.low))
    x0 = np.clip(start, free.low + margin, free.high - margin)
    result = least_squares(
        residuals,
        x0,
        jac=derivative,
        bounds=(free.low, free.high),
        method="trf",
        x_scale="jac",
        max_nfev=evaluations,
        ftol=tolerance,
        xtol=tolerance,
        gtol=1e-10,
    )
    return Fit(free, result.x, result.fun, result.jac, float(result.cost), count)
