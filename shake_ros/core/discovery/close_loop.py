"""Closing the loop with measured data: declared fit, search for the missing effects, what remains; one result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shake_ros.core.discovery.declared_fit import FittedModel, fit_declared, fitted_model
from shake_ros.core.discovery.forward_selection import Selection, forward_selection
from shake_ros.core.discovery.problem import ModelStructure, Progress, ScoredFit, SearchProblem, linearised
from shake_ros.core.discovery.remaining import Remaining, remaining
from shake_ros.core.discovery.search_settings import SearchSettings
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recordings import FULL, DeclaredModel, Record


@dataclass(frozen=True)
class LoopClosure:
    """Result of closing the loop: models before and after, the steps between them, what remains."""

    baseline: FittedModel
    models: tuple[FittedModel, ...]
    search: Selection
    remaining: Remaining
    noise: dict[str, float]
    model: DeclaredModel = FULL

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
) -> LoopClosure:
    """Find what the declared model lacks.

    Parameters
    ----------
    model : declared model with its free parameters and the effects that it may lack.
    estimation, validation : recordings that are fitted, and others that judge what is added.
    settings : thresholds of the search. progress : called with a text and the part done, 0 … 1.
    """
    problem = SearchProblem.of(model, estimation, validation, settings, progress)
    declared = fit_declared(problem, FreeParameters(model.table, model.free))
    found = forward_selection(problem, declared, model)
    if problem.estimation.records != list(estimation):
        progress("final fit to all recordings", 0.8)
        problem, found = on_whole(problem, found, estimation)
    progress("errors and what remains", 0.9)
    models = tuple(fitted_model(m.fit, problem.estimation, problem.validation) for m in found.models)
    rest = remaining(problem, found)
    return LoopClosure(models[0], models[1:], found, rest, problem.estimation.noise(), model.simulator)


def on_whole(problem: SearchProblem, found: Selection, estimation: Sequence[Record]) -> tuple[SearchProblem, Selection]:
    """Problem and models on all estimation data: the final model fitted to them, those before it as they are."""
    whole, settings = problem.on_whole(estimation), problem.settings

    def fitted(final: ScoredFit) -> ScoredFit:
        return whole.fitted(final.fit.free, final.fit.x, settings.converging_evaluations, settings.converged)

    return whole, found.on(lambda m: whole.scored(linearised(whole.estimation, m.fit)), fitted)
