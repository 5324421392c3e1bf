"""Closing the loop with measured data: declared fit, search for the missing effects, what remains; one result.

A search goes on where it stopped, on more recordings (`continued`): it begins with the effects found, at their values.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from shake_ros.explain.dependence import UNKNOWN, Remaining, remaining
from shake_ros.explain.latent_force import LatentForce, latent_forces
from shake_ros.failures import RAISING, Failures
from shake_ros.fit.declared_model import FULL, DeclaredModel
from shake_ros.fit.least_squares import never, time_is_over, within_budget
from shake_ros.fit.nuisances.estimates import estimated_null_shifts, without_null_shifts
from shake_ros.fit.nuisances.sensor_filter import filter_of
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.records import Record
from shake_ros.fit.solver import Budget
from shake_ros.fit.start.backlash import BACKLASH, shows_backlash
from shake_ros.search.answer import LAGS, OF_POSITION, answer
from shake_ros.search.closed_form import LearntFunction, learnt_function
from shake_ros.search.decision import ForwardStep, log_odds, taken_out
from shake_ros.search.declared_fit import FittedModel, fitted_model, unassessed_model
from shake_ros.search.problem import ModelStructure, Progress, ScoredFit, SearchProblem, Stopped, unstopped
from shake_ros.search.refined_nodes import refined_function
from shake_ros.search.search_settings import SearchSettings
from shake_ros.search.second_quantities import function_of_two, with_second_quantity
from shake_ros.search.selection import GivenAnswer, Selection, selection_of, with_all
from shake_ros.search.unlisted_functions import best_function, leaves_far_less, near_noise
from shake_ros.search.verdict import EffectVerdict, with_verdicts


@dataclass(frozen=True)
class LoopClosure:
    """Result of closing the loop: models before and after, the steps between them, what remains.

    verdicts : on each step's effect. candidates : effects that helped and are not established.
    with_candidates : held-out errors of the model that has them too, as FittedModel.validation; empty without any.
    function : the one without a name, where it was needed. forces : that the final model lacks, by recording.
    unpredictable : mean square that process noise and sensor noise leave over that of sensor noise, where equal
    commands show it; 1 elsewhere.
    """

    baseline: FittedModel
    models: tuple[FittedModel, ...]
    search: Selection
    remaining: Remaining
    noise: dict[str, float]
    model: DeclaredModel = FULL
    verdicts: tuple[EffectVerdict, ...] = ()
    candidates: tuple[EffectVerdict, ...] = ()
    with_candidates: dict[str, dict[str, float]] = field(default_factory=dict)
    function: LearntFunction | None = None
    forces: tuple[LatentForce, ...] = ()
    unpredictable: float = 1.0

    @property
    def final(self) -> FittedModel:
        """The model after the last step."""
        return self.models[-1] if self.models else self.baseline


def close_loop(
    model: ModelStructure,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    settings: SearchSettings,
    progress: Progress,
    deadline_passed: Callable[[], bool] = never,
    failures: Failures = RAISING,
) -> LoopClosure:
    """Find what the declared model lacks.

    Parameters
    ----------
    model : declared model with its free parameters and the effects that it may lack.
    estimation, validation : recordings that are fitted, and others by which what is added is accepted.
    settings : thresholds of the search. progress : called with a text and the part done, 0 … 1; where it
        raises `Stopped`, the search ends with what it has.
    deadline_passed : whether what follows the search is to end as well; asked within its fits.
    failures : takes the errors of what comes after the fit of the declared model; the rest is done without it.
    """
    problem = SearchProblem.of(model, estimation, validation, settings, unstopped(progress))
    problem, selection = searched(problem, model, estimation, validation, progress, deadline_passed, failures)
    with within_budget(deadline_passed):  # the verdicts come from fits that have ended, as long as there is time
        return concluded(replace(problem, progress=unstopped(progress)), selection, model, estimation, failures)


class FittedAnswer(NamedTuple):
    """An answer of the search, the recordings with the null shifts that it tells, and its fit of free runs."""

    given: GivenAnswer
    problem: SearchProblem
    fit: ScoredFit

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of its effects."""
        return tuple(c.effect for c in self.given.effects)

    @property
    def left(self) -> float:
        """Validation cost over that of the noise [-]."""
        return self.fit.validation_cost / self.problem.validation.noise_cost()

    @property
    def whole(self) -> bool:
        """Whether the model is of a whole table, neither reduced nor shaken: slow motion can go on from its fit."""
        return issubclass(self.given.likelihood, Predictor)


def searched(
    problem: SearchProblem,
    model: ModelStructure,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    progress: Progress,
    deadline_passed: Callable[[], bool],
    failures: Failures,
) -> tuple[SearchProblem, Selection]:
    """The listed effects that a model lacks, or an unlisted one; the problem with what they show of the recordings.

    progress : of `problem` as well, but for `Stopped`, which it may raise.
    """
    begun, budget = problem, Budget(over=time_is_over)

    def fitted(model: ModelStructure, slow: bool) -> FittedAnswer:
        def report(line: str) -> None:
            begun.progress(f"slow motion: {line}" if slow else line, 0.3)

        given = answer(model, estimation, validation, budget, report, failures, slow=slow)
        with within_budget(deadline_passed):  # what the search has found is fitted even where it was stopped
            shifted = begun.with_nuisances(given.nuisances)
            return FittedAnswer(given, shifted, with_all(shifted, model, given))

    best = fitted(model, slow=False)
    while best.whole and not (budget.over() or near_noise(best.problem, best.fit)):
        more = fitted(model.from_found(best.fit.fit.table, best.effects), slow=True)
        known, best = set(best.effects), min(best, more, key=lambda f: f.left)
        if best is not more or set(more.effects) == known:
            break
    with within_budget(deadline_passed):
        with failures.step("nuisance parameters"):
            best = with_nuisances(best)
            best = without_needless_lags(best, model.between)
        problem, found = best.problem, selection_of(best.problem, model, best.given, best.fit)
    with failures.step("search for an unlisted effect"), contextlib.suppress(Stopped):
        found = with_function(replace(problem, progress=progress), found)
    with failures.step("search beside process noise"):
        problem, found = beside_process_noise(problem, found)
    return problem, found


def beside_process_noise(problem: SearchProblem, found: Selection) -> tuple[SearchProblem, Selection]:
    """The models scored with what differs between equal commands counted as noise, where these show process noise.

    What free runs have found comes first: what depends on time differs between equal commands as well, and is no
    process noise once the model has it.
    """
    with_predictor = problem.with_predictor(found.final.fit)
    if with_predictor is problem:
        return problem, found

    def again(m: ScoredFit) -> ScoredFit:
        return with_predictor.scored(m.fit)

    return with_predictor, found.on(again, again)


def judged(
    problem: SearchProblem, found: Selection, shown: Sequence[str]
) -> tuple[Selection, tuple[EffectVerdict, ...], tuple[EffectVerdict, ...]]:
    """As of `with_verdicts`, on predictor runs where process noise shows: free runs carry it along, and it hides much.

    Free runs judge a model with backlash all the same: no predictor follows its contacts.
    shown : effects that the recordings show without a model.
    """
    if problem.predictor_rate <= 0.0 or any(step.chosen.candidate.narrow for step in found.steps):
        return with_verdicts(problem, found, shown)
    judge = problem.on_predictor_runs(found.final.fit)
    found, verdicts, dropped = with_verdicts(judge, found.on(judge.again, judge.again), shown)
    return found.on(problem.again, problem.again), verdicts, dropped


def with_nuisances(best: FittedAnswer) -> FittedAnswer:
    """An answer with the nuisance parameters that its fit gives the recordings."""
    problem, known = best.problem, best.given.nuisances
    estimates = known.updated(problem.estimation, problem.validation.records, best.fit.fit)
    updated = problem.with_nuisances(estimates)
    return FittedAnswer(replace(best.given, nuisances=estimates), updated, recentred(best.fit, problem, updated))


def without_needless_lags(best: FittedAnswer, between: Sequence[str]) -> FittedAnswer:
    """An answer without the sensors' lags where another delay of the accelerometer's filter explains as much.

    The search takes the delay beside that filter as it was first found, when other effects were missing too.
    between : effects that stay: the sensors show them without a model.
    """
    unknown = best.problem.estimation.model.nuisances
    for lag in (c for c in best.given.effects if unknown and c.effect in LAGS and c.effect not in between):
        time = best.fit.fit.table.value(lag.strength.name)
        behind = filter_of(best.problem.estimation.records[0]).later(-time if lag.effect == OF_POSITION else time)
        others = tuple(c for c in best.given.effects if c is not lag)
        given = replace(best.given, effects=others, nuisances=replace(best.given.nuisances, behind=behind))
        problem = best.problem.with_nuisances(given.nuisances)
        fit = problem.converged_from(*taken_out(problem, best.fit, lag, ()))
        lesser = with_nuisances(FittedAnswer(given, problem, fit))
        lesser = lesser._replace(fit=lesser.problem.converged_again(lesser.fit))
        best = lesser if log_odds(best.fit, lesser.fit, 1) <= 0.0 else best
    return best


def recentred(model: ScoredFit, before: SearchProblem, after: SearchProblem) -> ScoredFit:
    """The same model where null shifts that were its own have gone into the recordings' commands."""
    own = without_null_shifts(model.fit, before.estimation.records, after.estimation.records)
    return replace(model, fit=own)


def with_function(problem: SearchProblem, found: Selection) -> Selection:
    """The selection with a function of one or two quantities, where it leaves far less than the listed effects.

    It takes their place where it leaves far less than they do without them, too: they stood in for it.
    """
    if found.stopped or near_noise(problem, found.final):
        return found
    for base in (Selection(found.declared, (), found.declared), found) if found.steps else (found,):
        functions = best_function(problem, base.final)
        best, step = functions.best, None
        if best is not None and leaves_far_less(problem, base.final, best.result):
            step = ForwardStep(best, (best,))
        step = step or function_of_two(problem, base.final, functions)
        if step is not None and leaves_far_less(problem, found.final, step.chosen.result):
            step = with_second_quantity(problem, refined_function(problem, step))
            return replace(base.with_step(step), functions=functions)
        found = replace(found, functions=functions)
    return found


def concluded(
    problem: SearchProblem,
    selection: Selection,
    model: ModelStructure,
    estimation: Sequence[Record],
    failures: Failures,
) -> LoopClosure:
    """The verdict on each effect, and what the final model leaves."""
    found, verdicts, dropped = selection, tuple[EffectVerdict, ...](), tuple[EffectVerdict, ...]()
    tentative, rest, function, forces = dict[str, dict[str, float]](), UNKNOWN, None, tuple[LatentForce, ...]()
    with failures.step("verdicts"):
        shown = (*model.between, *((BACKLASH,) if shows_backlash(estimation) else ()))
        found, verdicts, dropped = judged(problem, selection, shown)
        tentative = problem.validation.errors(selection.final.fit.vector) if dropped else {}
    searched = problem.estimation.blocks()
    with failures.step("final fit"):
        if problem.partial:
            problem.progress("final fit to all estimation data", 0.8)
            problem, found = on_whole(problem, found, estimation)
        found = found.on(lambda m: m, problem.refitted) if problem.predictor_rate > 0.0 else found
        problem, found = centred(problem, found)
    problem.progress("errors and remaining residual", 0.9)
    models = tuple(unassessed_model(m.fit) for m in found.models)
    with failures.step("errors"):
        models = passed_through(problem, found, searched)
    with failures.step("what remains"):
        rest = remaining(problem, found)
    problem.progress("estimating the missing force", 0.95)
    with failures.step("latent force"):
        forces = latent_forces(problem, models[-1].table)
    with failures.step("closed form"):
        function = learnt_function(problem, found.final)
    concluded = verdicts, dropped, tentative, function, forces, problem.estimation.unpredictable
    noise = problem.estimation.noise()
    return LoopClosure(models[0], models[1:], found, rest, noise, model.simulator, *concluded)


def centred(problem: SearchProblem, found: Selection) -> tuple[SearchProblem, Selection]:
    """Problem and models with the null shifts of the final model in the recordings' commands."""
    first, second = problem.estimation, problem.validation
    shifts = estimated_null_shifts(first.model, found.final.fit, first.records, second.records)
    known = replace(found.nuisances, shifts={**found.nuisances.shifts, **shifts})
    updated = problem.with_nuisances(known)

    def moved(m: ScoredFit) -> ScoredFit:
        return recentred(m, problem, updated)

    return updated, replace(found.on(moved, moved), nuisances=known)


def passed_through(problem: SearchProblem, found: Selection, searched: np.ndarray) -> tuple[FittedModel, ...]:
    """The models of a search with their errors, the final one last; where an effect left the model it stands there too.

    searched : blocks of the data that the models before it were fitted to, shape (n,).
    """
    fits, data = [m.fit for m in found.models], (problem.estimation, problem.validation)
    return tuple(fitted_model(f, *data, None if f is fits[-1] else searched) for f in fits)


def on_whole(problem: SearchProblem, found: Selection, estimation: Sequence[Record]) -> tuple[SearchProblem, Selection]:
    """Problem and models on all estimation data: the final model fitted to them, those before it as they are."""
    whole = problem.on_whole(estimation).with_nuisances(found.nuisances)
    return whole, found.on(lambda m: m, whole.converged_again)


def continued(
    model: ModelStructure,
    before: LoopClosure,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    settings: SearchSettings,
    progress: Progress,
    deadline_passed: Callable[[], bool] = never,
    failures: Failures = RAISING,
) -> LoopClosure:
    """The result of a search on more recordings.

    Parameters
    ----------
    model : declared model with its free parameters and the effects that it may lack.
    before : result on fewer recordings.
    estimation, validation : all recordings, the new ones too.
    settings, progress, deadline_passed, failures : as of `close_loop`.
    """
    begin = model.from_found(before.search.final.fit.table, before.search.effects)
    return close_loop(begin, estimation, validation, settings, progress, deadline_passed, failures)
