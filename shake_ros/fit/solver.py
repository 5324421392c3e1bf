"""Least squares within bounds on whitened innovations: Levenberg–Marquardt, gains and levels renewed as it goes.

Loss (4.1), normal matrix (4.10), damping (4.12). Between two renewals of the gains the problem is one of smooth least
squares; the log likelihood of the filter judges what the renewals bring.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from shake_ros.fit.likelihood import Likelihood
from shake_ros.fit.model import FreeModel

REACH, NARROWER = 1.0, 4.0  # first step in scales (or parts of a value, below); ratio of the two that are tried
STEPS = 4  # Jacobians between two estimates of the levels of noise
NARROWEST = 1e-3  # reach at which a fit ends
KEPT, LEAST = 3, 0.5  # steps for which a Jacobian is kept, corrected by Broyden, while the foreseen fall comes within
PART = 0.25  # of a value that counts as one scale where it is more
LEVELS = ("force", "acceleration", "position", "memory")


class Budget:
    """How long a search may take: a deadline that everything below asks, and nothing else.

    seconds : from now on. over : whether something else asks it to end.

    >>> Budget(0.0).over(), Budget(60.0).over()
    (True, False)
    """

    def __init__(self, seconds: float = math.inf, over: Callable[[], bool] = lambda: False) -> None:
        self._deadline, self._over = time.monotonic() + seconds, over

    def over(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() >= self._deadline or self._over()


@dataclass(frozen=True)
class PredictorFit:
    """A model fitted to segments.

    Attributes
    ----------
    model : with the values found. prediction : under the gains of these values. likelihood : log likelihood by block,
    shape (b,). settled : whether the last steps gained less than the tolerance.
    """

    model: FreeModel
    prediction: Likelihood
    likelihood: np.ndarray
    settled: bool = False

    @property
    def total(self) -> float:
        """Log likelihood with the priors'."""
        return float(np.sum(self.likelihood)) - 0.5 * float(np.sum(prior_residuals(self.model, self.model.x) ** 2))


def prior_residuals(model: FreeModel, x: np.ndarray) -> np.ndarray:
    """Departure from the priors over their standard deviations, shape (k,)."""
    rows, targets = model.prior
    return np.asarray(rows @ x - targets)


def differences(prediction: Likelihood, model: FreeModel, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameter vectors at x and a step along each parameter, shape (1 + p, WIDTH), and these steps, shape (p,)."""
    step = prediction.difference * np.maximum(1.0, np.abs(x))
    step = np.where(x + step > model.bounds[1], -step, step)
    return model.vectors(np.vstack([x, x + np.diag(step)])), step


def jacobian(prediction: Likelihood, model: FreeModel, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals, shape (N,), and their differences per unit of x, shape (N, p)."""
    tried, step = differences(prediction, model, x)
    rows = prediction.residuals(tried)
    return rows[0], (rows[1:] - rows[0]).T / step


def step_within(
    normal: np.ndarray,
    gradient: np.ndarray,
    x: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    reach: float = math.inf,
) -> np.ndarray:
    """The Gauss–Newton step within bounds, two of shape (p,), and within a reach of x, shape (p,)."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
    upper = np.linalg.cholesky(normal / np.outer(scale, scale) + 1e-9 * np.eye(len(x))).T
    target = np.linalg.solve(upper.T, -gradient / scale)
    most = reach * np.maximum(1.0, PART * np.abs(x))
    margin = 1e-9 * np.maximum(1.0, np.abs(x))
    low = np.maximum(bounds[0] - x, -most) - margin
    high = np.minimum(bounds[1] - x, most) + margin
    found = lsq_linear(upper, target, (low * scale, high * scale))
    return np.asarray(np.clip(x + found.x / scale, *bounds) - x)


def descend(
    prediction: Likelihood, model: FreeModel, steps: int, tolerance: float, budget: Budget
) -> tuple[FreeModel, int]:
    """Fit under held gains: the model, and how many Jacobians were taken.

    Two reaches are tried with each Jacobian; the next ones follow the better of them. A Jacobian that foresees what
    comes is kept for some steps with rank-one corrections (Broyden 1965, Mathematics of Computation 19, 577).

    Parameters
    ----------
    steps : Jacobians at most. tolerance : fall of the cost, half the sum of squares, at which it stops.
    """
    reach, taken = REACH, 1
    x, rows = model.x, model.prior[0]
    r, j = jacobian(prediction, model, x)
    prior = prior_residuals(model, x)
    cost = 0.5 * float(r @ r) + 0.5 * float(prior @ prior)
    age = 0
    while not budget.over():
        normal, gradient = j.T @ j + rows.T @ rows, j.T @ r + rows.T @ prior
        reaches = (reach, reach / NARROWER)
        tried = np.array([x + step_within(normal, gradient, x, model.bounds, d) for d in reaches])
        left = prediction.residuals(model.vectors(tried))
        priors = [prior_residuals(model, t) for t in tried]
        costs = 0.5 * np.sum(left**2, axis=1) + 0.5 * np.array([float(p @ p) for p in priors])
        best = int(np.argmin(costs))
        fall, step = cost - float(costs[best]), tried[best] - x
        if fall > 0.0:
            expected = r + j @ step
            foreseen = cost - 0.5 * float(expected @ expected) - 0.5 * float(priors[best] @ priors[best])
            cost, x, r, prior = cost - fall, tried[best], left[best], priors[best]
            reach *= NARROWER if best == 0 else 1.0
            if fall < tolerance and age == 0:
                break
            if age < KEPT and LEAST * foreseen < fall < foreseen / LEAST and fall >= tolerance:
                j = j + np.outer(r - expected, step / float(step @ step))
                age += 1
                continue
        else:
            reach /= NARROWER**2
            if reach < NARROWEST:
                break
            if age == 0:
                continue
        if taken == steps:
            break
        r, j = jacobian(prediction, model, x)
        age, taken = 0, taken + 1
    return model.at(x), taken


def fit(
    begun: Sequence[Likelihood],
    model: FreeModel,
    budget: Budget,
    *,
    steps: int = 10,
    tolerance: float = 3.0,
    levels: tuple[str, ...] = LEVELS,
) -> PredictorFit:
    """Fit a model: least squares under the gains where it stands, then gains and levels of noise anew, and again.

    Under held gains the way is that of a smooth least-squares problem; the likelihood need not rise on it, so the
    best model on the way is kept. The levels come after: where a model stands before its fit they would be far too
    large, and hold it there.

    Parameters
    ----------
    begun : the recordings at levels of noise; it goes on from those under which the first steps lead to the likeliest
    model. steps : Jacobians at most.
    tolerance : gain in log likelihood at which it stops. levels : of noise that are estimated.
    """

    def at(prediction: Likelihood, model: FreeModel) -> PredictorFit:
        return PredictorFit(model, prediction, prediction.log_likelihood())

    def further(best: PredictorFit) -> tuple[PredictorFit, int]:
        moved, used = descend(best.prediction, best.model, min(STEPS, steps - taken), tolerance, budget)
        return at(best.prediction.tuned(moved.vectors(moved.x)[0], levels), moved), used

    vector, taken = model.vectors(model.x)[0], 0
    starts = [at(p.filtered(vector), model) for p in {p.levels: p for p in begun}.values()]
    best = max(starts, key=lambda f: f.total)
    while taken < steps and not budget.over():
        now, used = max((further(f) for f in starts), key=lambda f: f[0].total)
        taken, gained = taken + used, now.total - best.total
        best = now if gained > 0.0 else best
        if gained < tolerance:
            return replace(best, settled=not budget.over())
        starts = [best]
    return best
