"""What a search has left open, as models: each rival refitted, so that it explains the recordings as well as it can.

A verdict that is not "established" leaves a question: another effect in the place of one that was named, the model
without it, or an effect that helped and was not established. The models of these answers are what a further recording
has to distinguish.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from shake_ros.fit.least_squares import Fit
from shake_ros.fit.records import Record
from shake_ros.fit.uncertainty import of_table
from shake_ros.repair.close_loop import LoopClosure
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import ForwardStep, Refit, in_its_place, rivals, without
from shake_ros.search.problem import ModelStructure, ScoredFit, SearchProblem, side_by_side
from shake_ros.search.search_settings import SearchSettings
from shake_ros.search.verdict import ESTABLISHED, ONE_OF_THESE, EffectVerdict

MOST = 4  # rivals that are kept, those that explain the recordings best


@dataclass(frozen=True)
class RivalModel:
    """An answer that the recordings leave possible.

    Attributes
    ----------
    name : how it differs from the model found, such as "soft_zone instead of dead_volume".
    result : its fit to the estimation data, with its costs.
    replaced : number of the step of the model found whose effect it lacks; None where it only has one more.
    candidate : the effect that it has in addition; None where it only lacks one.
    """

    name: str
    result: ScoredFit
    replaced: int | None = None
    candidate: CandidateEffect | None = None

    @cached_property
    def fit(self) -> Fit:
        """Its fit, of the table's parameters alone."""
        return of_table(self.result.fit)

    def effects(self, found: Sequence[str]) -> tuple[str, ...]:
        """The effects that it has, of those of the model found in the order of its steps."""
        kept = [name for number, name in enumerate(found) if number != self.replaced]
        return (*kept, *([self.candidate.effect] if self.candidate else []))


def problem_of(
    closed: LoopClosure, estimation: Sequence[Record], validation: Sequence[Record], settings: SearchSettings
) -> SearchProblem:
    """The problem of a finished search, for fits that go on from it."""
    free = closed.search.final.fit.free
    model = ModelStructure(free.base, free.free, simulator=closed.model)
    return SearchProblem.of(model, estimation, validation, settings, lambda *_: None)


def rival_models(problem: SearchProblem, closed: LoopClosure) -> tuple[RivalModel, ...]:
    """The rivals of the model found, those that explain the recordings best first; none where nothing is open."""
    found, made = closed.search, list[RivalModel]()
    for number, (step, verdict) in enumerate(zip(found.steps, closed.verdicts, strict=True)):
        if verdict.state != ESTABLISHED:
            made += _instead_of(problem, closed, number, step, verdict)
    final = found.final
    for verdict in closed.candidates:
        if verdict.model is not None:
            fitted = problem.converged_again(verdict.model)
            if fitted.score < final.score:
                made.append(RivalModel(f"with {verdict.effect}", fitted, None, verdict.candidate))
    return tuple(sorted(made, key=lambda r: r.result.score)[:MOST])


def _instead_of(
    problem: SearchProblem, closed: LoopClosure, number: int, step: ForwardStep, verdict: EffectVerdict
) -> list[RivalModel]:
    """The model with another effect in the place of one that is not established, and where it is likely without it."""
    found, settings, effect = closed.search, problem.settings, step.chosen.candidate.effect
    close = rivals(found.steps, step, settings.most_refitted)
    if verdict.state == ONE_OF_THESE:
        close = [r for r in close if r.candidate.effect in verdict.alternatives]

    def instead(other: Refit) -> RivalModel:
        result = in_its_place(problem, found.final, step, other.candidate, other.result.fit.table)
        return RivalModel(f"{other.candidate.effect} instead of {effect}", result, number, other.candidate)

    made = list(side_by_side(instead, close))
    if verdict.state != ONE_OF_THESE:
        less = without(problem, found.final, step.chosen.candidate, found.near_without(effect))
        made.append(RivalModel(f"without {effect}", less, number))
    return made
