"""The search for what a reduced model or a driven axis lacks: the effect that helps most, then the one that helps most
beside it.

Each step screens all effects and refits all that promise anything. The best is added when it lowers the weighted error
of the validation data by more than chance and model floor explain, and that of the estimation data as well. Effects
that these recordings cannot distinguish from it are named with it as alternatives. At the end earlier effects are tried
for removal.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace

from shake_ros.core.discovery.answers import found_by_now
from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.decision import ForwardStep, decide, improves
from shake_ros.core.discovery.declared_fit import with_late_parameters
from shake_ros.core.discovery.elimination import eliminate
from shake_ros.core.discovery.problem import ModelStructure, ScoredFit, SearchProblem, Stopped, side_by_side
from shake_ros.core.discovery.refit import Refit, ranked, refitted
from shake_ros.core.discovery.screening import screen
from shake_ros.core.discovery.selection import Selection
from shake_ros.core.failures import RAISING, Failures
from shake_ros.core.identification.fit import Fit


def forward_selection(
    problem: SearchProblem, declared: Fit, model: ModelStructure, failures: Failures = RAISING
) -> Selection:
    """Add effects to the declared model until none lowers the error on validation data; take out the needless.

    Parameters
    ----------
    declared : fit of the declared model to the estimation data. model : with the effects that it may lack.
    failures : takes an error of the search, which then ends with what it has found.
    """
    current = problem.scored(declared)
    found, done = Selection(current, (), current), False
    with failures.step("search"), contextlib.suppress(Stopped):
        current = with_late_parameters(problem, current)
        for grown in stages(problem, Selection(current, (), current), model.candidates):
            found = grown
            if found.steps and not found.rejected:
                names = [s.chosen.candidate.effect for s in found.steps]
                problem.progress(found_by_now(problem, names, found.final, found.declared), 0.0)
        steps, final, removed = eliminate(problem, found.steps, found.final)
        found, done = replace(found, steps=steps, final=final, removed=removed), True
    return replace(found, stopped=not done)


def stages(problem: SearchProblem, found: Selection, left: tuple[CandidateEffect, ...]) -> Iterator[Selection]:
    """The selection as it grows, each stage a whole answer."""
    yield found
    while left and len(found.steps) < problem.settings.most_effects and not problem.at_noise(found.final):
        step, ranking, current = forward_step(problem, found.final, left)
        if current is not found.final:
            found = found.with_better_fit(current)
        if step is None:
            yield replace(found, rejected=ranking)
            return
        found = found.with_step(step)
        yield found
        left = tuple(c for c in left if c.effect != step.chosen.candidate.effect)


def forward_step(
    problem: SearchProblem, current: ScoredFit, candidates: tuple[CandidateEffect, ...]
) -> tuple[ForwardStep | None, tuple[Refit, ...], ScoredFit]:
    """Screen, refit, decide.

    Returns
    -------
    (step, or None where no effect improves the model; the ranking; the current fit)
        The current fit comes back better where a richer model has shown that it had not converged.
    """
    settings, tried = problem.settings, len(candidates)
    screening = screen(problem, current, candidates)
    effects = [t.candidate.effect for t in screening.best]
    problem.progress(f"fitting with {len(effects)} effects, each alone", 0.1)
    refits = ranked(side_by_side(lambda effect: refitted(problem, screening, effect), effects))
    if not refits:
        return None, refits, current
    current = reconverged(problem, current, refits[0])
    if not improves(refits[0].result, current, settings, tried):
        return None, refits, current
    step = decide(refits, screening.trials, settings, problem.validation.noise_cost())
    return step, step.ranking, current


def reconverged(problem: SearchProblem, current: ScoredFit, best: Refit) -> ScoredFit:
    """The current fit, or a better one of the same model that starts where the best refit has led its parameters."""
    problem.progress("repeating the fit without it", 0.9)
    settings, free = problem.settings, current.fit.free
    start = best.result.fit.x[: len(current.fit.x)]
    again = problem.fitted(free, start, settings.converging_evaluations, settings.converged)
    return again if again.fit.cost < (1.0 - settings.least_estimation_gain) * current.fit.cost else current
