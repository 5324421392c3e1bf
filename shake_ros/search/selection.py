"""What a search has found so far: the fit of the declared model, the steps from it, the final fit.

A search over sets of effects (answer.py) names them and gives values near the end of a fit; the models along the way,
from the declared one to that with all effects, are fitted here to free runs from these values, and assessed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import best_start
from shake_ros.fit.likelihood import FreeRuns, Likelihood
from shake_ros.fit.nuisances.estimates import NuisanceEstimates
from shake_ros.fit.slow_runs import SlowRuns
from shake_ros.fit.start.narrow_valleys import from_slow_to_fast
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import ForwardStep, Refit, absent_on, decide, in_its_place, ranked, taken_out
from shake_ros.search.declared_fit import declared_model
from shake_ros.search.problem import ModelStructure, ScoredFit, SearchProblem
from shake_ros.search.unlisted_functions import FunctionSearch


@dataclass(frozen=True)
class Selection:
    """Fit of the declared model, steps, final fit.

    removed : effects taken out again. without : by effect, a table near the fit without it. functions : what was tried
    for something that no listed effect explains. stopped : whether the search ended before it was done. nuisances :
    estimates of the recordings' nuisance parameters with its models.
    """

    declared: ScoredFit
    steps: tuple[ForwardStep, ...]
    final: ScoredFit
    removed: tuple[str, ...] = ()
    without: Mapping[str, TableParameters] = field(default_factory=dict)
    functions: FunctionSearch | None = None
    stopped: bool = False
    nuisances: NuisanceEstimates = field(default_factory=NuisanceEstimates)

    @property
    def models(self) -> tuple[ScoredFit, ...]:
        """Fits of the declared model and after each step; the final one where an effect was taken out since."""
        gone = tuple(f"effects.{effect}." for effect in self.removed)
        along = [step.chosen.result for step in self.steps[:-1]]
        along = (
            [self.final if any(n.startswith(gone) for n in f.fit.free.names) else f for f in along] if gone else along
        )
        return (self.declared, *along, *([self.final] if self.steps else []))

    def on(self, moved: Callable[[ScoredFit], ScoredFit], last: Callable[[ScoredFit], ScoredFit]) -> Selection:
        """The same models on other data: `last` makes the final one, `moved` those before."""
        if not self.steps:
            again = last(self.final)
            return replace(self, declared=again, final=again)
        final, steps = last(self.final), list[ForwardStep]()
        for step in self.steps:
            result = final if step is self.steps[-1] else moved(step.chosen.result)
            chosen = replace(step.chosen, result=result)
            steps.append(replace(step, chosen=chosen, ranking=(chosen, *step.ranking[1:])))
        return replace(self, declared=moved(self.declared), steps=tuple(steps), final=final)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects of its steps."""
        return tuple(step.chosen.candidate.effect for step in self.steps)

    def near_without(self, effect: str) -> list[TableParameters]:
        """Tables near the fit without one of the effects; none where the search has no such fit."""
        known = [self.without[effect]] if effect in self.without else []
        return [*known, self.declared.fit.table] if len(self.steps) == 1 else known

    def with_step(self, step: ForwardStep) -> Selection:
        """One effect more."""
        return replace(self, steps=(*self.steps, step), final=step.chosen.result)


@dataclass(frozen=True)
class GivenAnswer:
    """Effects with the values that a search has found.

    Attributes
    ----------
    table : with all of them. effects : candidates, the one that explains most first. rivals : candidates that explain
    nearly as much in the place of an effect, each with a table that has it. without : by effect, a table fitted without
    it. stopped : whether the search ended before it was done. likelihood : by which it was found.
    nuisances : with the null shifts that it tells.
    """

    table: TableParameters
    effects: tuple[CandidateEffect, ...]
    rivals: Mapping[str, Sequence[tuple[CandidateEffect, TableParameters]]]
    without: Mapping[str, TableParameters] = field(default_factory=dict)
    stopped: bool = False
    likelihood: type[Likelihood] = FreeRuns
    nuisances: NuisanceEstimates = field(default_factory=NuisanceEstimates)


def selection_of(problem: SearchProblem, model: ModelStructure, answer: GivenAnswer, near: ScoredFit) -> Selection:
    """The declared model and that with all effects, fitted to free runs; those between roughly, each from the next.

    near : the fit with all effects, near its end.
    """
    final = problem.converged_again(near)
    if not answer.effects:
        return Selection(final, (), final, stopped=answer.stopped, nuisances=answer.nuisances)
    declared = declared_model(problem, model, lacking=True)
    models = [final]
    for candidate in answer.effects[:0:-1]:
        known = answer.without.get(candidate.effect) if models[0] is final else None
        free, start = taken_out(problem, models[0], candidate, [model.table if known is None else known])
        models.insert(0, problem.roughly(free, start, near=True))
    steps = list[ForwardStep]()
    for candidate, before, after in zip(answer.effects, [declared, *models[:-1]], models, strict=True):
        chosen = Refit(candidate, after, 1.0 - after.estimation_cost / max(before.estimation_cost, 1e-300))
        steps.append(ForwardStep(chosen, (chosen,)))
    found = Selection(
        declared, tuple(steps), final, without=answer.without, stopped=answer.stopped, nuisances=answer.nuisances
    )
    return found if answer.stopped else with_rivals(problem, found, answer.rivals)


def with_all(problem: SearchProblem, model: ModelStructure, answer: GivenAnswer) -> ScoredFit:
    """The fit of free runs with all effects, near its end.

    An effect with a narrow valley that a search in slow motion has found for the first time comes to it band by band.
    """
    effects, settings = answer.effects, problem.settings
    if not effects:
        return declared_model(problem, model)
    problem.progress(f"fitting free runs with {' + '.join(c.effect for c in effects)}", 0.5)
    free = [*model.free, *model.late, *(p for c in effects for p in c.free)]
    parameters = FreeParameters(absent_on(answer.table, effects, answer.table), free)
    tables = [answer.table]
    if model.fitted is not None and {c.effect for c in effects} == set(model.shown):
        tables.append(model.fitted)  # a fit of free runs from where the search began
    start = best_start(problem.estimation, parameters, np.array([parameters.x_on(t) for t in tables]))
    new = [c for c in effects if c.narrow and c.effect not in model.shown]
    if new and answer.likelihood is SlowRuns:
        problem.progress("slow motion first, then faster", 0.7)
        own = [p.name for c in new for p in reversed(c.free)]
        start = from_slow_to_fast(problem.estimation_pieces, parameters, start, own)
    return problem.fitted(parameters, start, settings.continued_evaluations, settings.continued_tolerance, near=True)


def with_rivals(
    problem: SearchProblem,
    found: Selection,
    rivals: Mapping[str, Sequence[tuple[CandidateEffect, TableParameters]]],
) -> Selection:
    """The selection once what could stand in the place of each effect has had its turn, fitted to the same recordings.

    rivals : by effect, each with a table that has it.
    """
    for number, step in enumerate(found.steps):
        others = rivals.get(step.chosen.candidate.effect, ())
        tried = [Refit(c, in_its_place(problem, found.final, step, c, there), 0.0) for c, there in others]
        now = replace(step.chosen, result=found.final)
        better = decide(problem, ranked([now, *tried]))
        steps = (*found.steps[:number], better, *found.steps[number + 1 :])
        found = replace(found, steps=steps, final=better.chosen.result)
    return found
