"""Refits of candidate effects with all free parameters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem, mean_square
from shake_ros.core.discovery.screening import ScreenedTrial, Screening
from shake_ros.core.identification.fit import Fit, Problem
from shake_ros.core.identification.free_parameters import FreeParameters

MOST_TRIALS = 7  # of an effect, the most promising first, from which a refit may start


@dataclass(frozen=True)
class Refit:
    """A candidate refitted together with all free parameters. predicted_gain : relative fall that screening foresaw."""

    candidate: CandidateEffect
    result: ScoredFit
    predicted_gain: float

    @property
    def score(self) -> float:
        """Of its fit."""
        return self.result.score

    @property
    def usual(self) -> bool:
        """Whether its fitted values are such as are met on real tables."""
        table = self.result.fit.table
        return all(low <= table.value(name) <= high for name, (low, high) in self.candidate.usual.items())


def ranked(refits: Iterable[Refit]) -> tuple[Refit, ...]:
    """Refits, the best score first."""
    return tuple(sorted(refits, key=lambda r: r.score))


def refitted(problem: SearchProblem, screening: Screening, effect: str) -> Refit:
    """An effect refitted to all estimation data, from its best start."""
    settings, trials = problem.settings, screening.of(effect)
    free, start = best_start(problem.estimation_pieces, screening.current, trials, settings.start_multiples)
    result = problem.fitted(free, start, settings.converging_evaluations, settings.converged)
    return Refit(trials[0].candidate, result, trials[0].gain)


def best_start(
    problem: Problem, current: Fit, trials: Sequence[ScreenedTrial], multiples: tuple[float, ...]
) -> tuple[FreeParameters, np.ndarray]:
    """Free parameters with an effect's own, and the best start: trials × multiples × (old | predicted) others."""
    candidate = trials[0].candidate
    free = current.free.extended(candidate.free)
    strength, neutral, starts = candidate.strength.name, candidate.neutral, []
    signs = (-1.0, 1.0) if candidate.signed else (1.0,)
    for t in trials[:MOST_TRIALS]:
        trial = dict(candidate.trials[t.trial])
        own = {t.part} if abs(t.part) >= min(multiples) else set()  # from nothing no other parameter has a slope
        for part in {*(sign * m for m in multiples for sign in signs), *own}:
            for others in (current.x, t.x):
                x = free.x_of({**trial, strength: neutral + part * (trial[strength] - neutral)})
                x[: len(current.x)] = others
                starts.append(np.clip(x, free.low, free.high))
    rows = np.array(starts)
    costs = [mean_square(r) for r in np.nan_to_num(problem.residuals(free.vectors(rows)), nan=1e3)]
    return free, rows[int(np.argmin(costs))]
