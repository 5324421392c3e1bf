"""Refits of candidate effects with all free parameters: short on pieces of the recordings, then on the whole."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem, mean_square, side_by_side
from shake_ros.core.discovery.screening import ScreenedTrial, Screening
from shake_ros.core.identification.fit import Fit, Problem
from shake_ros.core.identification.free_parameters import FreeParameters


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
        table = self.result.fit.free.table(self.result.fit.x)
        return all(low <= table.value(name) <= high for name, (low, high) in self.candidate.usual.items())


def ranked(*groups: Iterable[Refit]) -> tuple[Refit, ...]:
    """All refits, the best score first."""
    return tuple(sorted((r for group in groups for r in group), key=lambda r: r.score))


def rounds(problem: SearchProblem, current: ScoredFit, screening: Screening) -> Iterator[list[str]]:
    """Effects to refit: the promising ones; where that was in vain and much is left above the noise, all others.

    Screening is linear. A table that sticks and breaks away is not, so a small promise may be a wrong one.
    """
    settings, best = problem.settings, screening.best
    first = [t.candidate.effect for t in best if t.gain > settings.least_screened][: settings.most_refits]
    if first:
        yield first
    others = [t.candidate.effect for t in best if t.candidate.effect not in first]
    if others and current.validation_cost > settings.much_left * problem.validation.noise_cost():
        yield others


def refit(
    problem: SearchProblem, screening: Screening, effects: list[str], known: tuple[Refit, ...]
) -> tuple[Refit, ...]:
    """Effects refitted on pieces of the recordings, the best of these and of those known on all; the best first."""
    settings, short = problem.settings, list[Refit]()
    most, tolerance = settings.continued_evaluations, settings.continued_tolerance
    problem.progress(f"refit with {effects[0]}", 0.1)
    for tried in side_by_side(lambda e: short_refit(problem, screening, e), effects):
        short.append(tried)
        problem.progress(f"refitted with {tried.candidate.effect}", 0.1 + 0.5 * len(short) / len(effects))
    refits = list(ranked(known, short))
    problem.progress(f"polish {refits[0].candidate.effect}", 0.6)
    refits[0] = continued(problem, refits[0], most, tolerance, screening.whole)
    near = [r for r in refits[1 : settings.most_continued] if r.score < settings.worth_continuing * refits[0].score]
    for tried in side_by_side(lambda r: continued(problem, r, most, tolerance, screening.whole), near):
        problem.progress(f"polished {tried.candidate.effect}", 0.8)
        refits = [tried if r.candidate is tried.candidate else r for r in refits]
    refits.sort(key=lambda r: r.score)
    for effect in passed_over(refits, screening):
        tried = refitted(problem, screening, effect, most, settings.resembling_tolerance)
        refits.append(continued(problem, tried, most, tolerance, screening.whole))
    return ranked(refits)


def passed_over(refits: Sequence[Refit], screening: Screening) -> list[str]:
    """Effects that the best refit resembles and that have not been refitted, though screening saw some gain."""
    tried = {r.candidate.effect for r in refits}
    alike = refits[0].candidate.resembles
    return [e for c in screening.candidates if (e := c.effect) in alike and e not in tried and screening.of(e)]


def short_refit(problem: SearchProblem, screening: Screening, effect: str) -> Refit:
    """A first refit of an effect."""
    settings = problem.settings
    return refitted(problem, screening, effect, settings.first_evaluations, settings.first_tolerance)


def refitted(problem: SearchProblem, screening: Screening, effect: str, evaluations: int, tolerance: float) -> Refit:
    """One effect refitted on pieces of the estimation data, from its best start."""
    settings, trials = problem.settings, screening.of(effect)
    best = trials[: settings.most_trials]
    free, start = best_start(problem.estimation_pieces, screening.current, best, settings.start_multiples)
    result = problem.fitted_to_pieces(free, start, evaluations, tolerance, screening.current)
    candidate = trials[0].candidate
    for _ in range(settings.most_hops):
        there = other_strength(problem, result.fit, candidate)
        if there is None:
            break
        again = problem.fitted_to_pieces(free, there, evaluations, tolerance, result.fit)
        if again.fit.cost >= result.fit.cost:
            break
        result = again
    return Refit(candidate, result, trials[0].gain)


def other_strength(problem: SearchProblem, result: Fit, candidate: CandidateEffect) -> np.ndarray | None:
    """Start at another strength of an effect where the others, adjusted to first order, would leave clearly less.

    A gap or a threshold makes narrow valleys: events come or stay away as a whole, and no gradient leads from one
    valley to the next.
    """
    settings, names = problem.settings, result.free.names
    i, scale = names.index(candidate.strength.name), result.free.scale
    rows = np.repeat(result.x[None, :], len(settings.hop_multiples), axis=0)
    neutral = candidate.neutral / scale[i]
    rows[:, i] = neutral + np.array(settings.hop_multiples) * (rows[:, i] - neutral)
    rows = np.clip(rows, result.free.low, result.free.high)
    moved = np.nan_to_num(problem.estimation_pieces.residuals(result.free.vectors(rows)), nan=1e3)
    others = [k for k in range(len(names)) if k != i]
    q, triangle = np.linalg.qr(result.jacobian[:, others])
    left = moved - (moved @ q) @ q.T
    best = int(np.argmin(np.einsum("ij,ij->i", left, left)))
    if float(left[best] @ left[best]) > settings.hop_promise * 2.0 * result.cost:
        return None
    change = np.linalg.lstsq(triangle, -q.T @ moved[best], rcond=1e-10)[0]
    rows[best, others] += np.clip(change, -settings.largest_shift, settings.largest_shift)
    return np.asarray(np.clip(rows[best], result.free.low, result.free.high))


def best_start(
    problem: Problem, current: Fit, trials: Sequence[ScreenedTrial], multiples: tuple[float, ...]
) -> tuple[FreeParameters, np.ndarray]:
    """Free parameters with an effect's own, and the best start: trials × multiples × (old | predicted) others."""
    candidate = trials[0].candidate
    free = current.free.extended(candidate.free)
    strength, neutral, starts = candidate.strength.name, candidate.neutral, []
    signs = (-1.0, 1.0) if candidate.signed else (1.0,)
    for t in trials:
        trial = dict(candidate.trials[t.trial])
        for part in {*(sign * m for m in multiples for sign in signs), t.part}:
            for others in (current.x, t.x):
                x = free.x_of({**trial, strength: neutral + part * (trial[strength] - neutral)})
                x[: len(current.x)] = others
                starts.append(np.clip(x, free.low, free.high))
    rows = np.array(starts)
    costs = [mean_square(r) for r in np.nan_to_num(problem.residuals(free.vectors(rows)), nan=1e3)]
    return free, rows[int(np.argmin(costs))]


def continued(
    problem: SearchProblem, tried: Refit, evaluations: int, tolerance: float, known: Fit | None = None
) -> Refit:
    """A refit continued on the whole estimation data. known : see `fit`; its own last Jacobian where not given."""
    start = tried.result.fit
    return replace(tried, result=problem.fitted(start.free, start.x, evaluations, tolerance, known or start))
