"""Least-squares fit of free parameters: trust-region reflective with bounds, Jacobian from batched simulations.

The problem gives weighted residuals for many parameter sets at once (so that all cores work); differences are forward,
inward at a bound, with a step of a small part of each parameter's scale, and corrected from step to step as long as
they foresee what comes. Loss (4.1), Gauss–Newton normal matrix (4.10).

Fits end where they are once the time budget is over, or once someone has interrupted the search. A fit asks between its
trial points, once it has a Jacobian. The budget belongs to a context, so that one search does not end the fits of
another in the same process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.optimize import least_squares

from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.physics.plant.parameters import TableParameters


def never() -> bool:
    """Fits go on to their end."""
    return False


_OVER: ContextVar[Callable[[], bool]] = ContextVar("over", default=never)


def time_is_over() -> bool:
    """Whether the time budget of this context is over."""
    return _OVER.get()()


@contextmanager
def within_budget(over: Callable[[], bool]) -> Iterator[None]:
    """Fits within end where they are once `over` says so."""
    token = _OVER.set(over)
    try:
        yield
    finally:
        _OVER.reset(token)


DIFFERENCE = 2e-3  # difference step as a part of a parameter's scale or of its value, whichever is larger
SMALL_DIFFERENCE = 2e-4  # the same of a smooth problem
CENTRAL = 1e-2  # the same to either side, where free runs bend within a small change
KEPT = 4  # steps for which the Jacobian of a smooth problem is kept
LEAST, MOST = 0.5, 2.0  # of the foreseen fall of the cost, between which it is
TRIALS = 2  # trial points for each of the Jacobians that a fit may take where it keeps them
LOST = 1e6  # weighted residual of a simulation that ends in no number
OVERFLOWING = 1e150  # the same of one whose square, summed, is none


class Problem(Protocol):
    """What a fit needs: weighted residuals for rows of parameter vectors, shape (m, len(NAMES)) → (m, n).

    It may say that it is `smooth`: that its residuals change with the parameters without small jumps; and which
    `difference` step is its own.
    """

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

    @property
    def table(self) -> TableParameters:
        """The table that was fitted."""
        return self.free.table(self.x)

    def after(self, evaluations: int) -> Fit:
        """The same, as the end of so many evaluations more."""
        return replace(self, evaluations=self.evaluations + evaluations)

    def __post_init__(self) -> None:
        if self.x.shape != (len(self.free.names),):
            raise ValueError(f"x of shape {self.x.shape} for {len(self.free.names)} free parameters")


def best_start(problem: Problem, free: FreeParameters, rows: np.ndarray) -> np.ndarray:
    """The row of x that leaves the least sum of squares, LOST a residual where there is no number, shape (p,)."""
    left = np.nan_to_num(problem.residuals(free.vectors(rows)), nan=LOST)
    return np.asarray(rows[int(np.argmin(np.sum(left**2, axis=1)))])


def is_smooth(problem: Problem) -> bool:
    """Whether a problem says so of itself."""
    return bool(getattr(problem, "smooth", False))


def difference_of(problem: Problem) -> float:
    """Difference step of a problem as a part of a parameter's scale or of its value."""
    own: float | None = getattr(problem, "difference", None)
    return own or (SMALL_DIFFERENCE if is_smooth(problem) else DIFFERENCE)


def jacobian(problem: Problem, free: FreeParameters, x: np.ndarray, residuals: np.ndarray) -> np.ndarray:
    """Differences of the residuals in one batch, shape (n, p): central where a parameter is narrow, else forward."""
    if free.narrow:
        step = (getattr(problem, "difference", None) or CENTRAL) * np.maximum(1.0, np.abs(x))
        more, less = np.minimum(x + step, free.high), np.maximum(x - step, free.low)
        tried = np.vstack([x, x + np.diag(more - x), x + np.diag(less - x)])
        moved = problem.residuals(free.vectors(tried))[1:]
        return (moved[: len(x)] - moved[len(x) :]).T / (more - less)
    step = difference_of(problem) * np.maximum(1.0, np.abs(x))
    step = np.where(x + step > free.high, -step, step)
    moved = problem.residuals(free.vectors(np.vstack([x, x + np.diag(step)])))  # all along the steps of the first
    return (moved[1:] - residuals).T / step


class Adjustment:
    """What the parameters of a Jacobian, shape (n, p), take off residuals to first order as they adjust."""

    def __init__(self, jacobian: np.ndarray) -> None:
        self._basis, self._triangle = np.linalg.qr(jacobian)

    def left(self, residuals: np.ndarray) -> np.ndarray:
        """What is left of residuals, shape (n,) or (n, m)."""
        return np.asarray(residuals - self._basis @ (self._basis.T @ residuals))

    def change(self, residuals: np.ndarray) -> np.ndarray:
        """Change of the parameters that takes most off residuals of shape (n,), shape (p,)."""
        return np.asarray(np.linalg.lstsq(self._triangle, -self._basis.T @ residuals, rcond=1e-10)[0])


class TimeOverError(Exception):
    """A fit is to end where it is."""


class KeptJacobian:
    """Residuals and Jacobian of a fit, the latter kept from step to step and corrected by what each step has shown.

    A rank-one correction (Broyden 1965, Mathematics of Computation 19, 577) costs no simulation where differences cost
    one for each parameter. They are taken anew where a step has not brought what was foreseen, after KEPT steps, and at
    each step of a problem that is not smooth.
    new : the last one that was taken. best : least cost that was met, where, and its residuals. taken, simulated : how
    many were, and parameter sets in all. age : of the present one, in corrections.
    """

    def __init__(self, problem: Problem, free: FreeParameters) -> None:
        self._problem, self._free = problem, free
        self.kept = KEPT if is_smooth(problem) else 0
        self._x, self._r, self._jacobian = np.zeros(0), np.zeros(0), np.zeros((0, 0))
        self._last: tuple[bytes, np.ndarray] = b"", np.zeros(0)
        self.new = self._jacobian
        self.best: tuple[float, np.ndarray, np.ndarray] = np.inf, self._x, self._r
        self.simulated = self.taken = self.age = 0

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Weighted residuals, LOST each where there is no number, or one that cannot be squared."""
        if (key := x.tobytes()) != self._last[0]:
            self._go_on()
            self.simulated += 1
            r = self._problem.residuals(self._free.vectors(x))[0]
            self._last = key, np.where(np.abs(r) < OVERFLOWING, r, LOST)
            if (cost := 0.5 * float(self._last[1] @ self._last[1])) < self.best[0]:
                self.best = cost, x.copy(), self._last[1]
        return self._last[1]

    def _go_on(self) -> None:
        if self.taken and time_is_over():
            raise TimeOverError

    def forget(self) -> None:
        """Take the next Jacobian anew."""
        self._x = np.zeros(0)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """The Jacobian at x, shape (n, p)."""
        r = self.residuals(x)
        if len(self._x) and self.age < self.kept:
            step = x - self._x
            foreseen = self._r + self._jacobian @ step
            before = self._r @ self._r
            if MOST * (before - foreseen @ foreseen) > before - r @ r > LEAST * (before - foreseen @ foreseen):
                self._jacobian = self._jacobian + np.outer(r - foreseen, step / (step @ step))
                self._x, self._r, self.age = x.copy(), r, self.age + 1
                return self._jacobian
        self._go_on()
        self.simulated += 1 + len(x) * (2 if self._free.narrow else 1)
        self.taken += 1
        found = jacobian(self._problem, self._free, x, r)
        self._x, self._r, self.new, self.age = x.copy(), r, np.where(np.abs(found) < OVERFLOWING, found, 0.0), 0
        self._jacobian = self.new
        return self.new


def fit(
    problem: Problem, free: FreeParameters, start: np.ndarray, *, evaluations: int = 40, tolerance: float = 1e-4
) -> Fit:
    """Minimise Σ r²/2 from `start` (in units of the scales).

    Parameters
    ----------
    evaluations : most Jacobians that are simulated, or trial points where each has its own. tolerance : relative change
        of the cost and of x at which it stops. When the time budget is over it ends at the best that it has met.
    """
    derivative = KeptJacobian(problem, free)
    try:
        return _fit(derivative, free, start, evaluations, tolerance)
    except TimeOverError:
        cost, x, r = derivative.best
        return Fit(free, x, r, derivative.new, cost, derivative.simulated)


def _fit(derivative: KeptJacobian, free: FreeParameters, start: np.ndarray, evaluations: int, tolerance: float) -> Fit:
    margin = 1e-9 * np.maximum(1.0, np.abs(free.low))
    x, cost = np.asarray(start, dtype=float), np.inf
    while True:
        result = least_squares(
            derivative.residuals,
            np.clip(x, free.low + margin, free.high - margin),
            jac=derivative,
            bounds=(free.low, free.high),
            method="trf",
            x_scale="jac",
            max_nfev=max(1, (TRIALS if derivative.kept else 1) * (evaluations - derivative.taken)),
            ftol=tolerance,
            xtol=tolerance,
            gtol=1e-10,
        )
        # what a corrected Jacobian takes for the end is one only where a new one sees nothing more
        if derivative.age == 0 or derivative.taken >= evaluations or result.cost > (1.0 - tolerance) * cost:
            break
        x, cost = result.x, result.cost
        derivative.forget()
    return Fit(free, result.x, result.fun, derivative.new, float(result.cost), derivative.simulated)
