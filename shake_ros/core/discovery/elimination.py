"""Backward elimination: effects that a later one has made needless are taken out again."""

from __future__ import annotations

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.decision import ForwardStep
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem
from shake_ros.core.identification.free_parameters import FreeParameters

FAR = 10.0  # times the score: without such an effect the model is so much worse that its fit need not converge


def without(problem: SearchProblem, current: ScoredFit, dropped: CandidateEffect) -> ScoredFit:
    """The fit with an effect taken out and everything else refitted; remembered, since elimination and standing ask."""
    settings, result, names = problem.settings, current.fit, {f.name for f in dropped.free}
    most = settings.continued_evaluations
    keep = [i for i, f in enumerate(result.free.free) if f.name not in names]
    key = (dropped.effect, result.free.names, result.x.tobytes())
    if key not in problem.reduced:
        free = FreeParameters(result.free.base, [result.free.free[i] for i in keep])
        reduced = problem.fitted(free, result.x[keep], most, settings.first_tolerance)
        if reduced.score < FAR * current.score:
            reduced = problem.fitted(free, reduced.fit.x, most, settings.converged, near=True)
        problem.reduced[key] = reduced
    return problem.reduced[key]


def eliminate(
    problem: SearchProblem, steps: tuple[ForwardStep, ...], current: ScoredFit
) -> tuple[tuple[ForwardStep, ...], ScoredFit, tuple[str, ...]]:
    """Steps still needed, the fit with them alone, effects taken out; the last effect has just proved its need."""
    problem.progress("are all needed?", 0.0)
    least, kept, removed = 1.0 - problem.settings.least_validation_gain, list(steps), list[str]()
    for step in steps[:-1]:
        reduced = without(problem, current, step.chosen.candidate)
        needless = reduced.estimation_cost * least < current.estimation_cost
        if needless and reduced.validation_cost * least < current.validation_cost:
            kept.remove(step)
            removed.append(step.chosen.candidate.effect)
            current = reduced
    return tuple(kept), current, tuple(removed)
