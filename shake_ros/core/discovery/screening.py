"""Screening: what would each effect, tried at finite values, take off the residual if everything else may adjust?

A score test along finite directions. With the fitted model's residual r and Jacobian J, and the residual r_t with the
effect tried at some values, the best linear combination r + J δ + s (r_t − r) over the parameters' change δ and the
effect's part s tells the cost that a refit would reach at least to first order, at the price of one simulation a trial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem, linearised, mean_square
from shake_ros.core.identification.fit import Adjustment, Fit, Problem, is_smooth


@dataclass(frozen=True)
class ScreenedTrial:
    """One trial. gain : predicted relative fall of the cost. part : multiple s of the trial. x : start for a refit."""

    candidate: CandidateEffect
    trial: int
    gain: float
    part: float
    x: np.ndarray


@dataclass(frozen=True)
class Screening:
    """Every trial of every candidate that promises anything, the most promising first.

    current : the model that was screened, on the pieces of the estimation data. candidates : all that were tried.
    whole : its cost on all estimation data, over that on the pieces [-].
    """

    current: Fit
    candidates: tuple[CandidateEffect, ...]
    trials: tuple[ScreenedTrial, ...]
    whole: float = 1.0

    def of(self, effect: str) -> list[ScreenedTrial]:
        """The trials of one effect."""
        return [t for t in self.trials if t.candidate.effect == effect]

    @property
    def best(self) -> list[ScreenedTrial]:
        """The most promising trial of each effect, in falling order of gain."""
        first: dict[str, ScreenedTrial] = {}
        for t in self.trials:
            first.setdefault(t.candidate.effect, t)
        return list(first.values())


class JointProblem:
    """Two problems as one, the residuals of the first in front."""

    def __init__(self, first: Problem, second: Problem) -> None:
        self._parts = first, second
        self.smooth = is_smooth(first)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals of both, shape (m, n)."""
        return np.hstack([part.residuals(vectors) for part in self._parts])


class ScoreTest:
    """Residuals r of a fit, against which directions are tested while its parameters adjust to first order.

    Parameters
    ----------
    residuals : shape (n,).
    jacobian : of the residuals by the parameters, shape (n, p).
    """

    def __init__(self, residuals: np.ndarray, jacobian: np.ndarray) -> None:
        self._adjustment = Adjustment(jacobian)
        self._residuals, self._total = residuals, float(residuals @ residuals)
        self._left = self._adjustment.left(residuals)
        self._least = float(self._left @ self._left)

    def gain(self, direction: np.ndarray, signed: bool, largest: float) -> tuple[float, float]:
        """Relative fall of the cost by r + J δ + s d, and the best s within ±largest (from 0 where it has no sign)."""
        d = self._adjustment.left(direction)
        power, slope = float(d @ d), float(d @ self._left)
        if power <= 1e-12 * self._total:
            return 0.0, 0.0
        part = float(np.clip(-slope / power, -largest if signed else 0.0, largest))
        return 1.0 - (self._least + part * (2.0 * slope + part * power)) / self._total, part

    def change(self, direction: np.ndarray, part: float) -> np.ndarray:
        """Change δ of the parameters that goes with a part of a direction, shape (p,)."""
        return self._adjustment.change(self._residuals + part * direction)


def screen(problem: SearchProblem, current: ScoredFit, candidates: tuple[CandidateEffect, ...]) -> Screening:
    """Score every trial of every candidate on pieces of the recordings.

    A trial is as promising as the better of what it promises on the estimation data and on all: an effect that the
    estimation data hardly show may be what the validation data lack. Starts for a refit come from the former alone.
    """
    problem.progress("screening", 0.0)
    pieces = linearised(problem.estimation_pieces, current.fit)
    both = JointProblem(problem.estimation_pieces, problem.validation_pieces)
    joint, seen = linearised(both, current.fit), len(pieces.residuals)
    pairs = [(c, i) for c in candidates for i in range(len(c.trials))]
    moved = both.residuals(np.array([trial_vector(current.fit, c, i) for c, i in pairs]))
    r, trials = joint.residuals, list[ScreenedTrial]()
    on_estimation, on_all = ScoreTest(r[:seen], joint.jacobian[:seen]), ScoreTest(r, joint.jacobian)
    largest, shift = problem.settings.largest_multiple, problem.settings.largest_shift
    for (candidate, i), other in zip(pairs, moved, strict=True):
        d = other - r
        if not np.all(np.isfinite(d)):
            continue
        gain, part = on_estimation.gain(d[:seen], candidate.signed, largest)
        gain = max(gain, on_all.gain(d, candidate.signed, largest)[0])
        if gain > 0.0:
            x = current.fit.x + np.clip(on_estimation.change(d[:seen], part), -shift, shift)
            trials.append(ScreenedTrial(candidate, i, gain, part, x))
    whole = current.estimation_cost / mean_square(pieces.residuals)
    return Screening(pieces, candidates, tuple(sorted(trials, key=lambda t: -t.gain)), whole)


def trial_vector(current: Fit, candidate: CandidateEffect, trial: int) -> np.ndarray:
    """All parameters of a model with a trial of an effect on top."""
    row, other = current.vector.copy(), current.table.with_values(candidate.trials[trial]).vector()
    row[: len(other)] = other
    row[current.free.columns] = current.vector[current.free.columns]
    return row
