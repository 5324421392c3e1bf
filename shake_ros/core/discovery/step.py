"""One step of the search: screen all effects, refit the promising ones, converge the best and its rivals, choose."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.discovery.judging import Attempt, Policy, pays, told_apart
from shake_ros.core.discovery.late import freed_late
from shake_ros.core.discovery.refits import (
    CONVERGED,
    attempt,
    carried_over,
    held_out,
    held_out_blocks,
    mean_square,
    measured,
    on_problem,
    polish,
    side_by_side,
)
from shake_ros.core.discovery.screening import Screened, screen
from shake_ros.core.identification.fit import Fit, Problem, fit
from shake_ros.core.identification.free_parameters import FreeParameter
from shake_ros.core.identification.recordings import RecordingProblem

Progress = Callable[[str, float], None]
Trials = Mapping[str, list[Screened]]  # by effect


@dataclass(frozen=True)
class Ground:
    """What a search stands on.

    problem, hold : recordings to learn from and held out. explore, explore_hold : pieces of them, for screening and
    first refits. late : declared parameters that are freed once they explain much of what is left above the noise.
    progress : called with what is being done and the part of the step that is done.
    """

    problem: RecordingProblem
    hold: RecordingProblem
    explore: RecordingProblem
    explore_hold: RecordingProblem
    late: tuple[FreeParameter, ...]
    policy: Policy
    progress: Progress


@dataclass(frozen=True)
class Step:
    """One added effect with the ranking it won and the alternatives that could not be told from it."""

    chosen: Attempt
    ranking: tuple[Attempt, ...]
    alternatives: tuple[str, ...]
    screened: tuple[Screened, ...]


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


def all_trials(ground: Ground, current: Fit, first_look: Fit, pool: tuple[Candidate, ...]) -> list[Screened]:
    """Every trial of every candidate, the most promising first."""
    ground.progress("screening", 0.0)
    both = Together(ground.explore, ground.explore_hold)
    return screen(both, on_problem(both, current), pool, len(first_look.residuals))


def first_refits(ground: Ground, first_look: Fit, own: Trials, names: list[str]) -> list[Attempt]:
    """Short refits of candidates on the first look, in the order of their names."""
    attempts: list[Attempt] = []
    ground.progress(f"refit with {names[0]}", 0.1)

    def short(name: str) -> Attempt:
        return attempt(ground.explore, ground.hold, first_look, own[name], ground.policy.evaluations, 1e-2)

    for tried in side_by_side(short, names):
        attempts.append(tried)
        ground.progress(f"refitted with {tried.candidate.effect}", 0.1 + 0.5 * len(attempts) / len(names))
    return attempts


def polished(
    ground: Ground,
    attempts: list[Attempt],
    first_look: Fit,
    own: Trials,
    pool: tuple[Candidate, ...],
) -> list[Attempt]:
    """The first few refitted on the whole recordings, with what the best of them resembles; the best first."""
    policy, most = ground.policy, ground.policy.final_evaluations
    ground.progress(f"polish {attempts[0].candidate.effect}", 0.6)
    attempts[0] = polish(ground.problem, ground.hold, attempts[0], most)
    close = [a for a in attempts[1 : policy.polished] if a.score < policy.worth_polishing * attempts[0].score]
    for tried in side_by_side(lambda a: polish(ground.problem, ground.hold, a, most), close):
        ground.progress(f"polished {tried.candidate.effect}", 0.8)
        attempts = [tried if a.candidate is tried.candidate else a for a in attempts]
    attempts.sort(key=lambda a: a.score)
    for candidate in unscreened_likes(attempts, pool):
        if candidate.effect in own:
            tried = attempt(ground.explore, ground.hold, first_look, own[candidate.effect], most, 1e-3)
            attempts.append(polish(ground.problem, ground.hold, tried, most))
    return sorted(attempts, key=lambda a: a.score)


def converged(ground: Ground, attempts: list[Attempt], current: Fit) -> tuple[list[Attempt], list[Attempt]]:
    """The best with what comes near or resembles it, all converged; and the rest.

    What does not improve on the model as it stands is no rival.
    """
    problem, hold, policy = ground.problem, ground.hold, ground.policy
    ground.progress(f"converge {attempts[0].candidate.effect}", 0.95)
    best = polish(problem, hold, attempts[0], policy.converging, CONVERGED)
    improved = (1.0 - 0.5 * policy.least_gain) * math.sqrt(mean_square(current.residuals) * held_out(hold, current))

    def rivals(a: Attempt) -> bool:
        near = a.score < policy.rival * best.score or a.candidate.effect in best.candidate.resembles
        return near and a.score < improved

    chosen = [a for a in attempts[1:] if rivals(a)]

    def settle(a: Attempt) -> Attempt:
        done = polish(problem, hold, a, policy.converging, CONVERGED)
        alike = a.candidate.effect in best.candidate.resembles
        return carried_over(problem, hold, best, done, policy.final_evaluations) if alike else done

    front = [best, *side_by_side(settle, chosen)]
    rest = [a for a in attempts[1:] if all(a is not b for b in chosen)]
    return front, rest


def finer(ground: Ground, tried: Attempt) -> Attempt:
    """An attempt with the late parameters freed, where they explain much of what it leaves."""
    better = freed_late(ground.problem, ground.hold, tried.fit, ground.late, ground.policy)
    return tried if better is tried.fit else measured(ground.hold, tried, better)


def one_step(ground: Ground, current: Fit, pool: tuple[Candidate, ...]) -> tuple[Step | None, tuple[Attempt, ...], Fit]:
    """Screen, refit, choose. Returns the step, or None where nothing pays, the ranking, and the current fit.

    The current fit comes back better where a richer model has shown that it had not converged.
    """
    policy = ground.policy
    first_look = on_problem(ground.explore, current)
    screened = all_trials(ground, current, first_look, pool)
    own = {s.candidate.effect: [t for t in screened if t.candidate.effect == s.candidate.effect] for s in screened}
    ranking: tuple[Attempt, ...] = ()
    for names in waves(ground, current, best_per_candidate(screened)):
        attempts = ranked(ranking, first_refits(ground, first_look, own, names))
        front, rest = converged(ground, polished(ground, list(attempts), first_look, own, pool), current)
        ranking = ranked(front, rest)
        if worth(ground.problem, ground.hold, current, ranking[0], policy, len(pool)):
            break
    else:
        return None, ranking, current
    ground.progress("without it once more", 0.98)
    current = settled(ground.problem, current, ranking[0], policy)
    if not worth(ground.problem, ground.hold, current, ranking[0], policy, len(pool)):
        return None, ranking, current
    ranking = ranked(side_by_side(lambda a: finer(ground, a), front), rest)
    noise = ground.hold.noise_cost()
    alike = [a for a in ranking if a is ranking[0] or not told_apart(ranking[0], a, policy, noise)]
    best = next((a for a in alike if a.usual), alike[0])
    ranking = (best, *(a for a in ranking if a is not best))
    likes = tuple(a.candidate.effect for a in alike if a is not best)
    return Step(best, ranking, likes, tuple(screened)), ranking, current


def waves(ground: Ground, current: Fit, screened: list[Screened]) -> Iterator[list[str]]:
    """Effects to refit: the promising ones; where that was in vain and much is left above the noise, all others.

    Screening is linear. A table that sticks and breaks away is not, so a small promise may be a wrong one.
    """
    policy, names = ground.policy, [s.candidate.effect for s in screened]
    first = [s.candidate.effect for s in screened if s.gain > policy.least_screened][: policy.refits]
    if first:
        yield first
    others = [name for name in names if name not in first]
    if others and held_out(ground.hold, current) > policy.much_left * ground.hold.noise_cost():
        yield others


def ranked(front: Iterable[Attempt], rest: Iterable[Attempt]) -> tuple[Attempt, ...]:
    """All attempts, the best score first."""
    return tuple(sorted((*front, *rest), key=lambda a: a.score))


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
