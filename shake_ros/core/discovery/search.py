"""The search: screen all effects, refit the promising ones, choose by held-out error, repeat until nothing pays.

An effect is added when it lowers the weighted error of the recordings that the fit has not seen by more than chance
and model floor explain, and lowers the error of those it has seen as well. Effects whose held-out error lies within a
small margin of the best are named with it as alternatives: these recordings cannot tell them apart. After each step the
earlier effects are tried for removal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.discovery.judging import Attempt, Policy
from shake_ros.core.discovery.late import freed_late
from shake_ros.core.discovery.refits import CONVERGED, held_out, mean_square, measured, on_problem
from shake_ros.core.discovery.step import Ground, Progress, Step, one_step
from shake_ros.core.discovery.unlisted import Unnamed, best_unlisted
from shake_ros.core.identification.fit import Fit, Problem, fit
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters
from shake_ros.core.identification.recordings import RecordingProblem


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


def at_noise(problem: RecordingProblem, hold: RecordingProblem, current: Fit, policy: Policy) -> bool:
    """Whether a fit leaves nothing above the sensor noise, on what it has seen and on what it has not."""
    learned = mean_square(current.residuals) <= policy.at_noise * problem.noise_cost()
    return learned and held_out(hold, current) <= policy.at_noise * hold.noise_cost()


def or_unlisted(
    ground: Ground, current: Fit, step: Step | None, ranking: tuple[Attempt, ...]
) -> tuple[Step | None, Unnamed | None]:
    """The step, or one that adds a function without a name where the listed effects explain too little.

    A function is estimated only where the held-out residual stands clearly above the noise and the best listed effect
    leaves most of it; it replaces a listed effect only where it leaves far less. What was looked at comes with it.
    """
    problem, hold, policy = ground.problem, ground.hold, ground.policy
    before = held_out(hold, current)
    listed = step.chosen.hold if step else before
    if before < policy.clearly_above * hold.noise_cost() or listed < policy.weak * before:
        return step, None
    first_look = on_problem(ground.explore, current)
    found = best_unlisted(problem, ground.explore, current, first_look, lambda f: held_out(hold, f), ground.progress)
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
    late : declared parameters that are freed once they explain much of what is left above the noise.
    """
    declared = freed_late(problem, hold, declared, late, policy)
    current, steps, left = declared, list[Step](), pool
    ground = Ground(problem, hold, explore or problem, explore_hold or hold, tuple(late), policy, progress)
    ranking: tuple[Attempt, ...] = ()
    unnamed: Unnamed | None = None
    while len(steps) < policy.most_effects and left and not at_noise(problem, hold, current, policy):
        before = current
        step, ranking, current = one_step(ground, current, left)
        if current is not before:
            declared, steps = with_last(declared, steps, current, hold)
            if step is None:
                continue
        step, unnamed = or_unlisted(ground, current, step, ranking)
        if step is None:
            break
        steps.append(step)
        current = step.chosen.fit
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
    chosen = measured(hold, last.chosen, better)
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
