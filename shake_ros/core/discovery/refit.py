"""Refits of candidate effects with all free parameters: short on pieces of the recordings, then on the whole."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from shake_ros.core.discovery.answers import leads
from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem, mean_square, side_by_side
from shake_ros.core.discovery.screening import ScreenedTrial, Screening
from shake_ros.core.identification.approach import Approach
from shake_ros.core.identification.by_bands import from_slow_to_fast
from shake_ros.core.identification.fit import Fit, Problem
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.time_budget import time_is_over

MOST_TRIALS = 7  # of an effect, the most promising first, from which a refit may start
MUCH_BETTER = 0.5  # of a score that was told, from which the same effect is told of again


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
    problem: SearchProblem, screening: Screening, effects: list[str], known: tuple[Refit, ...], current: ScoredFit
) -> tuple[Refit, ...]:
    """Effects refitted on pieces of the recordings, the best of these and of those known on all; the best first.

    Once all have begun a search that is to stop has an answer there, so the step goes on, with fits that end early.

    current : the model without them; which of them leads against it is told on the way.
    """
    settings = problem.settings
    most, tolerance = settings.continued_evaluations, settings.continued_tolerance
    refits = list(ranked(known, first_refits(problem, screening, effects, current)))
    problem = problem.unstopped()
    first = refits[0]
    report_best(problem, first, current)
    problem.progress(f"improving the fit with {first.candidate.effect}", 0.6)
    refits[0] = continued(problem, first, most, tolerance)
    near = [r for r in refits[1 : settings.most_continued] if r.score < settings.worth_continuing * refits[0].score]
    for tried in side_by_side(lambda r: continued(problem, r, most, tolerance), near):
        problem.progress(f"improved the fit with {tried.candidate.effect}", 0.8)
        refits = [tried if r.candidate is tried.candidate else r for r in refits]
    refits.sort(key=lambda r: r.score)
    for effect in passed_over(refits, screening):
        least = settings.resembling_tolerance
        tried = finished(problem, screening, begun(problem, screening, effect, most, least), most, least)
        refits.append(continued(problem, tried, most, tolerance))
    found = ranked(refits)
    if found[0].candidate is not first.candidate or found[0].score < MUCH_BETTER * first.score:
        report_best(problem, found[0], current)
    return found


def report_best(problem: SearchProblem, best: Refit, current: ScoredFit) -> None:
    """Tell which effect leads, where the model is clearly better with it."""
    if best.score < (1.0 - problem.settings.clear_gain) * current.score:
        problem.progress(leads(problem, best.candidate.effect, best.result, current), 0.6)


def passed_over(refits: Sequence[Refit], screening: Screening) -> list[str]:
    """Effects that the best refit resembles and that have not been refitted, though screening saw some gain."""
    tried = {r.candidate.effect for r in refits}
    alike = refits[0].candidate.resembles
    return [e for c in screening.candidates if (e := c.effect) in alike and e not in tried and screening.of(e)]


def first_refits(problem: SearchProblem, screening: Screening, effects: list[str], current: ScoredFit) -> list[Refit]:
    """First refits of effects; of the leading one alone where it keeps its promise."""
    lead, short = leading(problem, screening, effects), list[Refit]()
    if lead:
        short = short_refits(problem, screening, lead)
        fall = 1.0 - min(r.result.estimation_cost for r in short) / current.estimation_cost
        if fall > problem.settings.lead_kept * screening.of(lead[0])[0].gain:
            return short
    return short + short_refits(problem, screening, [e for e in effects if e not in lead])


def leading(problem: SearchProblem, screening: Screening, effects: Sequence[str]) -> list[str]:
    """The effect that promises far more than all others, with those that it resembles; else empty."""
    settings, best = problem.settings, [t for t in screening.best if t.candidate.effect in effects]
    lead = [e for e in effects if e == best[0].candidate.effect or e in best[0].candidate.resembles]
    others = max((t.gain for t in best if t.candidate.effect not in lead), default=0.0)
    clear = best[0].gain > settings.lead_promise and others < settings.lead_rival * best[0].gain
    return lead if clear and len(lead) < len(effects) else []


def short_refits(problem: SearchProblem, screening: Screening, effects: list[str]) -> list[Refit]:
    """First refits of effects; those of which predictor runs show already that another one is far better end there."""
    settings, on_way, short = problem.settings, list[Begun](), list[Refit]()
    most, tolerance = settings.first_evaluations, settings.first_tolerance
    problem.progress(f"fitting with {effects[0]}", 0.1)
    for first in side_by_side(lambda e: begun(problem, screening, e, most, tolerance), effects):
        on_way.append(first)
        problem.progress(f"first fit with {first.trial.candidate.effect}", 0.1 + 0.25 * len(on_way) / len(effects))
    problem = problem.unstopped()
    bound = settings.hopeless * min(each.way.predictor_cost for each in on_way)

    def ended(each: Begun) -> Refit:
        return finished(problem, screening, each, most if each.way.predictor_cost <= bound else 1, tolerance)

    for tried in side_by_side(ended, on_way):
        short.append(tried)
        problem.progress(f"fitted with {tried.candidate.effect}", 0.35 + 0.25 * len(short) / len(effects))
    if all(problem.leaves_much(each.way) for each in on_way):
        least = min(r.result.fit.cost for r in short)
        for i, each in enumerate(on_way):
            if each.trial.candidate.narrow and not time_is_over():
                other = finished(problem, screening, sought(problem, each, least), most, tolerance)
                short[i] = min(short[i], other, key=attrgetter("score"))
    return short


@dataclass(frozen=True)
class Begun:
    """A refit on pieces of the estimation data that has begun. trial : the most promising one of its effect."""

    trial: ScreenedTrial
    free: FreeParameters
    way: Approach


def begun(problem: SearchProblem, screening: Screening, effect: str, evaluations: int, tolerance: float) -> Begun:
    """A refit of one effect on its way, from its best start."""
    trials, multiples = screening.of(effect), problem.settings.start_multiples
    free, start = best_start(problem.estimation_pieces, screening.current, trials, multiples)
    return Begun(trials[0], free, problem.way_to_pieces(free, start, evaluations, tolerance))


def sought(problem: SearchProblem, begun: Begun, most: float) -> Begun:
    """The same from slow to fast motion, of an effect that is hardly met otherwise.

    Friction begins as declared, which other effects have bent. most : half the sum of squares that the best of the
    others leaves; the way ends where it is far above.
    """
    candidate, free = begun.trial.candidate, begun.free
    own = [f.name for f in reversed(candidate.free)]
    begins = np.array([name.startswith("friction.") or name in own for name in free.names])
    starts = [np.where(begins, free.x_of(point), begun.way.start) for point in candidate.narrow]
    problem.progress(f"fitting {candidate.effect}, slow motion first", 0.3)
    return replace(begun, way=Approach(from_slow_to_fast(problem.estimation_pieces, free, starts, own, most)))


def finished(problem: SearchProblem, screening: Screening, begun: Begun, evaluations: int, tolerance: float) -> Refit:
    """The refit at its end."""
    result = problem.fitted_to_pieces(begun.free, begun.way, evaluations, tolerance, screening.whole)
    return Refit(begun.trial.candidate, result, begun.trial.gain)


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


def continued(problem: SearchProblem, tried: Refit, evaluations: int, tolerance: float) -> Refit:
    """A refit continued on the whole estimation data."""
    start, near = tried.result.fit, not tried.result.preliminary
    return replace(tried, result=problem.fitted(start.free, start.x, evaluations, tolerance, near=near))
