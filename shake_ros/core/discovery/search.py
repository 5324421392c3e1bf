"""The search: screen all effects, refit the promising ones, choose by held-out error, repeat until nothing pays.

An effect is added when it lowers the weighted error of the recordings that the fit has not seen by more than chance
and model floor explain, and lowers the error of those it has seen as well. Effects whose held-out error lies within a
small margin of the best are named with it as alternatives: these recordings cannot tell them apart. After each step the
earlier effects are tried for removal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.discovery.judging import Attempt, Policy, pays, told_apart
from shake_ros.core.discovery.late import freed_late
from shake_ros.core.discovery.refits import (
    CONVERGED,
    attempt,
    held_out,
    held_out_blocks,
    mean_square,
    on_problem,
    polish,
    side_by_side,
)
from shake_ros.core.discovery.screening import Screened, screen
from shake_ros.core.discovery.unlisted import Unnamed, best_unlisted
from shake_ros.core.identification.fit import Fit, Problem, fit
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters
from shake_ros.core.identification.recordings import RecordingProblem

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Step:
    """One added effect with the ranking it won and the alternatives that could not be told from it."""

    chosen: Attempt
    ranking: tuple[Attempt, ...]
    alternatives: tuple[str, ...]
    screened: tuple[Screened, ...]


@dataclass(frozen=True)
class Search:
    """Declared fit, steps, final fit.

    rejected : the ranking of the last round, which nothing passed. unnamed : functions without a name that were tried
    in it.
    """

    declared: Fit
    steps: tuple[Step, ...]
    final: Fit
    removed: tuple[str, ...] = ()
    rejected: tuple[Attempt, ...] = field(default=())
    unnamed: Unnamed | None = None


class Together:
    """Two problems as one, the residuals of the first in front."""

    def __init__(self, first: Problem, second: Problem) -> None:
        self._parts = first, second

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals of both, shape (m, n)."""
        return np.hstack([part.residuals(vectors) for part in self._parts])


def best_per_candidate(screened: Sequence[Screened]) -> list[Screened]:
    """The most promising trial of each candidate, in falling order of gain."""
    first: dict[str, Screened] = {}
    for s in screened:
        first.setdefault(s.candidate.effect, s)
    return list(first.values())


def unscreened_likes(attempts: Sequence[Attempt], pool: tuple[Candidate, ...]) -> list[Candidate]:
    """Candidates that the best attempt resembles and that screening has passed over."""
    tried = {a.candidate.effect for a in attempts}
    return [c for c in pool if c.effect in attempts[0].candidate.resembles and c.effect not in tried]


def one_step(
    problem: Problem,
    hold: RecordingProblem,
    explore: Problem,
    explore_hold: Problem,
    current: Fit,
    pool: tuple[Candidate, ...],
    policy: Policy,
    progress: Progress,
) -> tuple[Step | None, tuple[Attempt, ...], Fit]:
    """Screen, refit, choose. Returns the step, or None where nothing pays, the ranking, and the current fit.

    The current fit comes back better where a richer model has shown that it had not converged.
    """
    progress("screening", 0.0)
    first_look = on_problem(explore, current)
    both = Together(explore, explore_hold)
    screened = screen(both, on_problem(both, current), pool, len(first_look.residuals))
    hopeful = [s for s in best_per_candidate(screened) if s.gain > policy.least_screened][: policy.refits]
    own = {s.candidate.effect: [t for t in screened if t.candidate.effect == s.candidate.effect] for s in screened}
    attempts = []
    names = [s.candidate.effect for s in hopeful]
    if not names:
        return None, (), current
    progress(f"refit with {names[0]}", 0.1)
    for tried in side_by_side(lambda n: attempt(explore, hold, first_look, own[n], policy.evaluations, 1e-2), names):
        attempts.append(tried)
        progress(f"refitted with {tried.candidate.effect}", 0.1 + 0.5 * len(attempts) / len(names))
    attempts.sort(key=lambda a: a.score)
    progress(f"polish {attempts[0].candidate.effect}", 0.6)
    attempts[0] = polish(problem, hold, attempts[0], policy.final_evaluations)
    close = [a for a in attempts[1 : policy.polished] if a.score < policy.worth_polishing * attempts[0].score]
    for tried in side_by_side(lambda a: polish(problem, hold, a, policy.final_evaluations), close):
        progress(f"polished {tried.candidate.effect}", 0.8)
        attempts = [tried if a.candidate is tried.candidate else a for a in attempts]
    attempts.sort(key=lambda a: a.score)
    for candidate in unscreened_likes(attempts, pool):
        if candidate.effect in own:
            tried = attempt(explore, hold, first_look, own[candidate.effect], policy.final_evaluations, 1e-3)
            attempts.append(polish(problem, hold, tried, policy.final_evaluations))
    attempts.sort(key=lambda a: a.score)
    progress(f"converge {attempts[0].candidate.effect}", 0.95)
    best = polish(problem, hold, attempts[0], policy.converging, CONVERGED)
    improved = (1.0 - 0.5 * policy.least_gain) * math.sqrt(mean_square(current.residuals) * held_out(hold, current))
    near = [a for a in attempts[1:] if a.score < min(policy.rival * best.score, improved)]
    rivals = list(side_by_side(lambda a: polish(problem, hold, a, policy.converging, CONVERGED), near))
    rest = [a for a in attempts[1:] if all(a is not b for b in near)]
    ranking = tuple(sorted((best, *rivals, *rest), key=lambda a: a.score))
    best = ranking[0]
    if not worth(problem, hold, current, best, policy, len(pool)):
        return None, ranking, current
    progress("without it once more", 0.98)
    current = settled(problem, current, best, policy)
    if not worth(problem, hold, current, best, policy, len(pool)):
        return None, ranking, current
    likes = [a.candidate.effect for a in ranking[1:] if not told_apart(best, a, policy, hold.noise_cost())]
    return Step(best, ranking, tuple(likes), tuple(screened)), ranking, current


def worth(problem: Problem, hold: RecordingProblem, current: Fit, best: Attempt, policy: Policy, tried: int) -> bool:
    """Whether the best of the candidates tried is better than the current fit beyond chance."""
    blocks, unseen = held_out_blocks(hold, current), held_out(hold, current)
    return pays(best, mean_square(current.residuals), blocks, unseen, policy, tried)


def settled(problem: Problem, current: Fit, best: Attempt, policy: Policy) -> Fit:
    """The current fit, or a better one of the same model that starts where the richer model has led its parameters.

    A fit that has stopped early would make any effect look useful whose refit merely goes on with the rest.
    """
    start = best.fit.x[: len(current.x)]
    again = fit(problem, current.free, start, evaluations=policy.converging, tolerance=CONVERGED)
    return again if again.cost < (1.0 - policy.least_learned) * current.cost else current


def at_noise(problem: RecordingProblem, hold: RecordingProblem, current: Fit, policy: Policy) -> bool:
    """Whether a fit leaves nothing above the sensor noise, on what it has seen and on what it has not."""
    learned = mean_square(current.residuals) <= policy.at_noise * problem.noise_cost()
    return learned and held_out(hold, current) <= policy.at_noise * hold.noise_cost()


def or_unlisted(
    problem: RecordingProblem,
    hold: RecordingProblem,
    explore: RecordingProblem,
    current: Fit,
    step: Step | None,
    ranking: tuple[Attempt, ...],
    policy: Policy,
    progress: Progress,
) -> tuple[Step | None, Unnamed | None]:
    """The step, or one that adds a function without a name where the listed effects explain too little.

    A function is estimated only where the held-out residual stands clearly above the noise and the best listed effect
    leaves most of it; it replaces a listed effect only where it leaves far less. What was looked at comes with it.
    """
    before = held_out(hold, current)
    listed = step.chosen.hold if step else before
    if before < policy.clearly_above * hold.noise_cost() or listed < policy.weak * before:
        return step, None
    found = best_unlisted(
        problem, explore, current, on_problem(explore, current), lambda f: held_out(hold, f), progress
    )
    if found.best is None:
        return step, found
    candidate, result, gain = found.best
    tried = Attempt(candidate, result, mean_square(result.residuals), held_out(hold, result), gain)
    if tried.hold > policy.far_less * listed or tried.learn > policy.far_less * mean_square(current.residuals):
        return step, found
    return Step(tried, (tried, *ranking), (), ()), found


def search(
    problem: RecordingProblem,
    hold: RecordingProblem,
    declared: Fit,
    pool: tuple[Candidate, ...],
    policy: Policy,
    progress: Progress = lambda text, part: None,
    explore: RecordingProblem | None = None,
    explore_hold: RecordingProblem | None = None,
    late: Sequence[FreeParameter] = (),
) -> Search:
    """Add effects to the declared fit until none lowers the held-out error.

    Parameters
    ----------
    problem, hold : recordings to learn from and held out. declared : fit of the declared model.
    pool : candidates. progress : called with what is being done and the part of the step that is done.
    explore, explore_hold : pieces of the recordings to learn from and held out, for screening and first refits; the
        whole of them where not given.
    late : declared parameters that are freed once they explain most of what is left above the noise.
    """
    declared = freed_late(problem, hold, declared, late, policy)
    current, steps, left = declared, list[Step](), pool
    explore = explore or problem
    ranking: tuple[Attempt, ...] = ()
    unnamed: Unnamed | None = None
    while len(steps) < policy.most_effects and left and not at_noise(problem, hold, current, policy):
        before = current
        step, ranking, current = one_step(problem, hold, explore, explore_hold or hold, current, left, policy, progress)
        if current is not before:
            declared, steps = with_last(declared, steps, current, hold)
            if step is None:
                continue
        step, unnamed = or_unlisted(problem, hold, explore, current, step, ranking, policy, progress)
        if step is None:
            break
        steps.append(step)
        current = freed_late(problem, hold, step.chosen.fit, late, policy)
        if current is not step.chosen.fit:
            declared, steps = with_last(declared, steps, current, hold)
        left = tuple(c for c in left if c.effect != step.chosen.candidate.effect)
        ranking = ()
        if step.chosen.candidate.effect == "unlisted":
            break
    progress("are all needed?", 0.0)
    kept, current, removed = prune(problem, hold, steps, current, policy)
    return Search(declared, tuple(kept), current, removed, ranking, unnamed)


def with_last(declared: Fit, steps: list[Step], better: Fit, hold: RecordingProblem) -> tuple[Fit, list[Step]]:
    """Declared fit and steps with a better fit of the last model among them."""
    if not steps:
        return better, steps
    last = steps[-1]
    learn, unseen, blocks = mean_square(better.residuals), held_out(hold, better), held_out_blocks(hold, better)
    chosen = replace(last.chosen, fit=better, learn=learn, hold=unseen, blocks=blocks)
    return declared, [*steps[:-1], replace(last, chosen=chosen, ranking=(chosen, *last.ranking[1:]))]


def without(problem: Problem, hold: Problem, current: Fit, dropped: Candidate, policy: Policy) -> tuple[Fit, float]:
    """The fit with an effect taken out and everything else refitted, and its held-out cost."""
    names = {f.name for f in dropped.free}
    keep = [i for i, f in enumerate(current.free.free) if f.name not in names]
    free = FreeParameters(current.free.base, [current.free.free[i] for i in keep])
    result = fit(problem, free, current.x[keep], evaluations=policy.final_evaluations, tolerance=CONVERGED)
    return result, held_out(hold, result)


def prune(
    problem: Problem, hold: Problem, steps: list[Step], current: Fit, policy: Policy
) -> tuple[list[Step], Fit, tuple[str, ...]]:
    """Take out effects that a later one has made needless; the last one has just proved its worth."""
    kept, removed = list(steps), list[str]()
    for step in steps[:-1]:
        reduced, cost = without(problem, hold, current, step.chosen.candidate, policy)
        needless = mean_square(reduced.residuals) * (1.0 - policy.least_gain) < mean_square(current.residuals)
        if needless and cost * (1.0 - policy.least_gain) < held_out(hold, current):
            kept.remove(step)
            removed.append(step.chosen.candidate.effect)
            current = reduced
    return kept, current, tuple(removed)
