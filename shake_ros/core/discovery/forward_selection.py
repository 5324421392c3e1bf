"""The search for what a model lacks: forward selection of effects with backward elimination.

Each step screens all effects, refits the promising ones and brings the best to convergence. An effect is added when it
lowers the weighted error of the validation data by more than chance and model floor explain, and that of the estimation
data as well. Effects that these recordings cannot distinguish from it are named with it as alternatives. At the end
earlier effects are tried for removal.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace

from shake_ros.core.discovery.answers import found_by_now, promising, without_name
from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.convergence import converge, reconverged, refined, with_late_parameters
from shake_ros.core.discovery.decision import ForwardStep, decide, improves
from shake_ros.core.discovery.elimination import eliminate
from shake_ros.core.discovery.problem import ModelStructure, ScoredFit, SearchProblem, Stopped, linearised
from shake_ros.core.discovery.refined_nodes import refined_function
from shake_ros.core.discovery.refit import Refit, ranked, refit, rounds
from shake_ros.core.discovery.screening import Screening, screen
from shake_ros.core.discovery.second_quantities import function_of_two, with_second_quantity
from shake_ros.core.discovery.selection import Selection
from shake_ros.core.discovery.shown_effects import joint_steps, shown_steps
from shake_ros.core.discovery.unlisted_functions import (
    UNLISTED,
    FunctionSearch,
    ScreenedFunction,
    leading_functions,
    or_function,
)
from shake_ros.core.failures import RAISING, Failures
from shake_ros.core.identification.fit import Fit
from shake_ros.core.identification.nuisance_estimates import without_null_shifts
from shake_ros.core.identification.time_budget import time_is_over


def forward_selection(
    problem: SearchProblem, declared: Fit, model: ModelStructure, failures: Failures = RAISING
) -> tuple[SearchProblem, Selection]:
    """Add effects to the declared model until none lowers the error on validation data; take out the needless.

    Returns the problem as well, with what its models have told of the recordings.

    Parameters
    ----------
    declared : fit of the declared model to the estimation data. model : with the effects that it may lack.
    failures : takes an error of the search, which then ends with what it has found.
    """
    current = problem.scored(declared)
    found, done = Selection(current, (), current), False
    with failures.step("search"), contextlib.suppress(Stopped):
        current = with_late_parameters(problem, current)
        for grown in stages(problem, Selection(current, (), current), model):
            before, found = [s.chosen.candidate for s in found.steps], grown
            added = [s.chosen.candidate for s in found.steps]
            if added != before:
                names = [f"an unlisted effect ({c.place})" if c.effect == UNLISTED else c.effect for c in added]
                problem.progress(found_by_now(problem, names, found.final, found.declared), 0.0)
        steps, final, removed = eliminate(problem.with_nuisances(found.nuisances), found.steps, found.final)
        found, done = replace(found, steps=steps, final=final, removed=removed), True
    return problem.with_nuisances(found.nuisances), replace(found, stopped=not done)


def with_predictor_search(
    problem: SearchProblem, found: Selection, model: ModelStructure
) -> tuple[SearchProblem, Selection]:
    """The search gone on with predictor runs beside the free ones, where equal commands still show process noise.

    It begins with what free runs alone have found: what depends on time differs between equal commands as well, and is
    no process noise once the model has it.
    """
    with_predictor = problem.with_predictor(found.final.fit)
    if with_predictor is problem:
        return problem, found

    def again(m: ScoredFit) -> ScoredFit:
        return with_predictor.scored(m.fit)

    found = found.on(again, again)
    present = {step.chosen.candidate.effect for step in found.steps}
    if found.stopped or UNLISTED in present:
        return with_predictor, found
    left = tuple(c for c in model.candidates if c.effect not in present)
    try:
        for grown in stages(with_predictor, found, replace(model, candidates=left)):
            found = grown
        steps, final, removed = eliminate(with_predictor, found.steps, found.final)
    except Stopped:
        return with_predictor, replace(found, stopped=True)
    return with_predictor, replace(found, steps=steps, final=final, removed=(*found.removed, *removed))


def stages(problem: SearchProblem, found: Selection, model: ModelStructure) -> Iterator[Selection]:
    """The selection as it grows, each stage a whole answer."""
    left = model.candidates
    for shown in shown_steps(problem, model, found.final) if model.shown else ():
        found = found.with_step(shown)
        left = tuple(c for c in left if c.effect != shown.chosen.candidate.effect)
    yield found
    while left and len(found.steps) < problem.settings.most_effects:
        problem, found = with_nuisances(problem, found)
        freed = with_late_parameters(problem, found.final) if found.steps else found.final
        found = found.with_better_fit(freed) if freed is not found.final else found
        yield found
        if problem.at_noise(found.final):
            break
        step, ranking, current, functions = forward_step(problem, found.final, left)
        improved = current is not found.final
        found = replace(found.with_better_fit(current) if improved else found, rejected=ranking)
        yield found
        if improved and step is None:
            continue  # the model without a further effect had not converged: look again at what it leaves now
        together = joint_steps(problem, model, current) if step is None and not found.steps else ()
        if together:
            for shown in together:
                found = found.with_step(shown)
            left = tuple(c for c in left if c.effect not in {s.chosen.candidate.effect for s in together})
            yield found
            continue
        listed = step is not None and step.chosen.candidate.effect != UNLISTED
        if step is None or (listed and not time_is_over()):
            step, functions = or_function(problem, current, step, ranking, None if improved else functions)
            if step is not None and step.chosen.candidate.effect == UNLISTED:
                step = refined_function(problem, step)
            elif step is None:
                step = function_of_two(problem, current, ranking, functions)
        found = replace(found, functions=functions)
        yield found
        if step is None:
            break
        before, found = found, found.with_step(step)
        yield found
        left = tuple(c for c in left if c.effect != step.chosen.candidate.effect)
        if step.chosen.candidate.effect == UNLISTED:
            found = before.with_step(with_second_quantity(problem, step))
            yield found
            break
    if found.steps:  # the final model has been fitted since it was last asked
        yield with_nuisances(problem, found)[1]


def with_nuisances(problem: SearchProblem, found: Selection) -> tuple[SearchProblem, Selection]:
    """Problem and models with the nuisance parameters that the final model gives the recordings."""
    known, others = found.nuisances, problem.validation.records
    estimates = known.updated(problem.estimation, others, found.final.fit)
    if estimates is known:
        return problem, found
    updated = problem.with_nuisances(estimates)
    return updated, replace(fitted_again(updated, recentred(problem, updated, found)), nuisances=estimates)


def recentred(problem: SearchProblem, updated: SearchProblem, found: Selection) -> Selection:
    """The same models where null shifts that were their own have gone into the recordings' commands."""
    before, after = problem.estimation.records, updated.estimation.records

    def moved(m: ScoredFit) -> ScoredFit:
        return replace(m, fit=without_null_shifts(m.fit, before, after))

    return found.on(moved, moved)


def fitted_again(problem: SearchProblem, found: Selection) -> Selection:
    """The models on other data: the final one fitted to them, those before it as they are."""
    return found.on(lambda m: problem.scored(linearised(problem.estimation, m.fit)), problem.converged_again)


def forward_step(
    problem: SearchProblem, current: ScoredFit, candidates: tuple[CandidateEffect, ...]
) -> tuple[ForwardStep | None, tuple[Refit, ...], ScoredFit, FunctionSearch | None]:
    """Screen, refit, converge, decide.

    Where a function promises far more than every effect, or the promising effects were in vain, it is tried before all
    others: it is the answer where it leaves nothing above the noise.

    Returns
    -------
    (step, or None where no effect improves the model; the ranking; the current fit; functions, where they were tried)
        The current fit comes back better where a richer model has shown that it had not converged.
    """
    settings, tried = problem.settings, len(candidates)
    screening = screen(problem, current, candidates)
    ranking: tuple[Refit, ...] = ()
    functions: FunctionSearch | None = None
    leading = leading_functions(problem, current, screening)
    report_promise(problem, screening, leading)
    for effects in rounds(problem, current, screening):
        if (ranking or leading) and functions is None:
            function, functions = clear_function(problem, current, ranking, leading)
            if function:
                return function, ranking, current, functions
        refits = refit(problem, screening, effects, ranking, current)
        unstopped = problem.unstopped()
        converged, others = converge(unstopped, current, refits)
        ranking = (*ranked(converged), *ranked(others))  # a fit to pieces is no answer, however well it scores
        if improves(ranking[0].result, current, settings, tried):
            break
    else:
        return None, ranking, current, functions
    current = reconverged(unstopped, current, ranking[0])
    if not improves(ranking[0].result, current, settings, tried):
        return None, ranking, current, functions
    ranking = (*ranked(refined(unstopped, converged)), *ranked(others))
    step = decide(ranking, screening.trials, settings, problem.validation.noise_cost())
    return step, step.ranking, current, functions


def report_promise(problem: SearchProblem, screening: Screening, leading: Sequence[ScreenedFunction]) -> None:
    """Tell what promises much before anything is fitted to it."""
    if leading:
        kind = leading[0].kind
        problem.progress(without_name(kind.place, kind.depends_on, leading[0].gain), 0.0)
    elif screening.trials and screening.trials[0].gain > problem.settings.worth_telling:
        problem.progress(promising(screening.trials[0].candidate.effect, screening.trials[0].gain), 0.0)


def clear_function(
    problem: SearchProblem, current: ScoredFit, ranking: tuple[Refit, ...], screened: Sequence[ScreenedFunction]
) -> tuple[ForwardStep | None, FunctionSearch | None]:
    """A step that adds a function which leaves nothing above the noise, if there is one; the functions tried."""
    function, functions = or_function(problem, current, None, ranking, screened=screened)
    if function and function.chosen.score < problem.settings.function_clear * current.score:
        function = refined_function(problem, function)
        if problem.at_noise(function.chosen.result):
            return function, functions
    return None, functions
