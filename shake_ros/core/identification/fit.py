"""Least-squares fit of free parameters: Levenberg–Marquardt in a box, with a Jacobian that is kept from step to step.

The problem gives weighted residuals for many parameter sets at once (so that all cores work); differences are forward,
inward at a bound, with a step of a small part of each parameter's scale. Loss (4.1), Gauss–Newton normal matrix (4.10).
A Jacobian by differences costs a simulation for each parameter, Broyden's update none: it is taken afresh where a step
keeps less than a quarter of what it promised, and once more before a fit counts as converged. Sources: Marquardt 1963;
Broyden 1965; damping after Nielsen 1999.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from shake_ros.core.identification.free_parameters import FreeParameters

DIFFERENCE = 2e-3  # difference step as a part of a parameter's scale or of its value, whichever is larger
EVEN = 1e-13  # eigenvalues of the scaled normal matrix below it are rounding
KEPT_PROMISE = 0.25  # part of the predicted fall below which an updated Jacobian is taken afresh
WHOLE_PROMISE = 0.75  # part of it above which the radius grows
SHORTEST = 1e-6  # part of the radius that a failed step leaves at least
LOOSE = 5e-3  # tolerance from which an updated Jacobian is enough to stop
FAILED = 1e6  # weighted residual of a simulation that ends in no number
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

    def __post_init__(self) -> None:
        if self.x.shape != (len(self.free.names),):
            raise ValueError(f"x of shape {self.x.shape} for {len(self.free.names)} free parameters")


def jacobian(
    problem: Problem, free: FreeParameters, x: np.ndarray, residuals: np.ndarray, known: Fit | None = None
) -> np.ndarray:
    """Forward differences of the residuals in one batch, shape (n, p).

    Parameters
    ----------
    known : a fit to the same data whose columns are taken as they are where it has the parameter.
    """
    step = DIFFERENCE * np.maximum(1.0, np.abs(x))
    step = np.where(x + step > free.high, -step, step)
    there = {name: j for j, name in enumerate(known.free.names)} if known else {}
    own = [i for i, name in enumerate(free.names) if name not in there]
    result = np.empty((len(residuals), len(x)), order="F")
    if own:
        moved = problem.residuals(free.vectors(x + np.diag(step)[own]))
        result[:, own] = (moved - residuals).T / step[own]
    for i, name in enumerate(free.names):
        if known and name in there:
            result[:, i] = known.jacobian[:, there[name]]
    return result


class _Descent:
    """Where a fit stands: x, residuals, Jacobian with its age in updates, damping."""

    def __init__(self, problem: Problem, free: FreeParameters, x: np.ndarray, known: Fit | None) -> None:
        self.problem, self.free, self.x = problem, free, x
        self.r, self.count = self.simulated(x), 1
        known = known if known and len(known.residuals) == len(self.r) else None
        self.j = self.fresh(known)
        self.radius = float(np.linalg.norm(np.linalg.norm(self.j, axis=0) * self.x)) or 1.0
        self.age = int(known is not None)

    def simulated(self, x: np.ndarray) -> np.ndarray:
        r = self.problem.residuals(self.free.vectors(x))[0]
        return np.where(np.isfinite(r), r, FAILED)

    def fresh(self, known: Fit | None = None) -> np.ndarray:
        j = jacobian(self.problem, self.free, self.x, self.r, known)
        self.count += len(self.x) - (sum(name in known.free.names for name in self.free.names) if known else 0)
        self.age = 0
        return np.where(np.isfinite(j), j, 0.0)

    @property
    def cost(self) -> float:
        return 0.5 * float(self.r @ self.r)

    def step(self, normal: np.ndarray, gradient: np.ndarray) -> np.ndarray:
        """The best step within the radius and the bounds; parameters that push against a bound stay."""
        low, high = self.free.low, self.free.high
        stay = ((self.x <= low) & (gradient > 0.0)) | ((self.x >= high) & (gradient < 0.0)) | (np.diag(normal) <= 0.0)
        move = np.zeros(len(self.x))
        while not stay.all():
            inside = np.flatnonzero(~stay)
            scale = 1.0 / np.sqrt(np.diag(normal)[inside])
            power, axes = np.linalg.eigh(normal[np.ix_(inside, inside)] * np.outer(scale, scale))
            power = np.maximum(power, EVEN)
            slope = axes.T @ (scale * (gradient + normal @ np.where(stay, move, 0.0))[inside])
            move[inside] = -scale * (axes @ (slope / (power + self.damping(power, slope))))
            beyond = ~stay & ((self.x + move < low) | (self.x + move > high))
            move = np.clip(self.x + move, low, high) - self.x
            if not beyond.any():
                break
            stay |= beyond
        return move

    def damping(self, power: np.ndarray, slope: np.ndarray) -> float:
        """Marquardt's λ for which a step is as long as the radius, 0 where the whole step is shorter."""
        low, high = 0.0, float(np.linalg.norm(slope)) / self.radius
        if np.linalg.norm(slope / power) <= self.radius:
            return 0.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if np.linalg.norm(slope / (power + middle)) > self.radius else (low, middle)
        return high

    def resize(self, length: float, kept: float, by_update: bool) -> None:
        """The radius after a step of a length that kept a part of its promise; an updated Jacobian may be at fault."""
        if kept > WHOLE_PROMISE and length > 0.9 * self.radius:
            self.radius *= 2.0
        elif kept < KEPT_PROMISE and not by_update:
            self.radius = max(0.25 * length, SHORTEST * self.radius)

    def updated(self, move: np.ndarray, r: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Broyden's update of the Jacobian, each parameter counted by its effect on the residuals."""
        weighted = weights * move
        return self.j + np.outer((r - self.r - self.j @ move) / float(weighted @ move), weighted)


def fit(
    problem: Problem,
    free: FreeParameters,
    start: np.ndarray,
    *,
    evaluations: int = 40,
    tolerance: float = 1e-4,
    known: Fit | None = None,
) -> Fit:
    """Minimise Σ r²/2 from `start` (in units of the scales).

    Parameters
    ----------
    evaluations : most trial points. tolerance : relative change of the cost and of x at which it stops.
    known : a fit from which the first Jacobian takes the columns that it has; nothing where it is one to other data.
    """
    at = _Descent(problem, free, np.clip(start, free.low, free.high), known)
    normal, gradient = at.j.T @ at.j, at.j.T @ at.r
    for _ in range(evaluations):
        move = at.step(normal, gradient)
        promised = -float(gradient @ move) - 0.5 * float(move @ normal @ move)
        small = float(np.linalg.norm(move)) <= tolerance * (tolerance + float(np.linalg.norm(at.x)))
        settled = abs(promised) <= 0.25 * tolerance * at.cost or small
        if settled and at.age == 0:
            break
        fall = 0.0
        if not settled:
            r, before = at.simulated(at.x + move), at.cost
            at.count += 1
            fall = before - 0.5 * float(r @ r)
            if fall > 0.0:
                at.j, at.x, at.r = at.updated(move, r, np.diag(normal)), at.x + move, r
                at.age += 1
        settled = settled or 0.0 < fall <= tolerance * at.cost
        if settled and (at.age <= int(fall > 0.0) or tolerance >= LOOSE):
            break
        kept = fall / promised if promised > 0.0 else 0.0
        at.resize(float(np.linalg.norm(np.sqrt(np.diag(normal)) * move)), kept, by_update=at.age > int(fall > 0.0))
        if fall <= 0.0 and at.age == 0:
            continue
        if settled or kept < KEPT_PROMISE:
            at.j = at.fresh()
        normal, gradient = at.j.T @ at.j, at.j.T @ at.r
    return Fit(free, at.x, at.r, at.j, at.cost, at.count)
