"""What a search stands on, built once: estimation and validation data, pieces, settings; and how a fit scores.

Estimation data are fitted, validation data judge. Pieces of the former are a cheaper problem for starts and functions.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from shake_ros.fit.declared_model import FULL, DeclaredModel
from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import LOST, Fit, Problem, fit, jacobian
from shake_ros.fit.nuisances.equal_commands import FreeAndPredictor, process_noise
from shake_ros.fit.nuisances.estimates import NuisanceEstimates
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, windows
from shake_ros.fit.start.narrow_valleys import INJECTION, approached, arrived, predictor_start
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import workers
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.search_settings import SearchSettings

T = TypeVar("T")
R = TypeVar("R")
Progress = Callable[[str, float], None]
FIRST, ROUGH = 4, 1e-2  # trial points and tolerance of a fit that shows whether a model is far worse


@dataclass(frozen=True)
class ModelStructure:
    """A declared model with what a fit may move and what it may lack.

    Attributes
    ----------
    table : values that a fit starts from. free, late : parameters that a fit may move, from the start or only once they
    explain much of what is left above the noise. candidates : effects that it may lack. simulator : of its free run.
    shown : effects among the candidates that show without a search; `fitted` is a table that has them. between : those
        of them by which the sensors differ, so that nothing that moves the table could stand for them.
    unbent : the table with the friction with which effects of friction are tried, where that is another one.
    """

    table: TableParameters
    free: tuple[FreeParameter, ...]
    late: tuple[FreeParameter, ...] = ()
    candidates: tuple[CandidateEffect, ...] = ()
    simulator: DeclaredModel = FULL
    fitted: TableParameters | None = None
    shown: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    unbent: TableParameters | None = None

    def from_found(self, table: TableParameters, effects: Sequence[str]) -> ModelStructure:
        """The same with the effects that a table has, from which a search goes on."""
        return replace(self, table=table.without(effects), fitted=table, shown=tuple(effects), unbent=None)


class Stopped(Exception):
    """A search is to end with what it has found; whoever receives its progress may raise it."""


def unstopped(progress: Progress) -> Progress:
    """Progress of what is done to its end even where the search is to stop."""

    def report(text: str, part: float) -> None:
        with contextlib.suppress(Stopped):
            progress(text, part)

    return report


def side_by_side(work: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
    """The same work on each item, in their order: fits do not depend on each other, and simulate without the GIL."""
    contexts = [copy_context() for _ in items]
    with ThreadPoolExecutor(workers()) as pool:
        yield from pool.map(lambda context, item: context.run(work, item), contexts, items)


def linearised(problem: Problem, result: Fit) -> Fit:
    """The same solution with the residuals and the Jacobian of another problem."""
    r = problem.residuals(result.free.vectors(result.x))[0]
    j = jacobian(problem, result.free, result.x, r)
    return Fit(result.free, result.x, r, j, 0.5 * float(r @ r), len(result.x) + 2)


def mean_square(residuals: np.ndarray) -> float:
    """Mean square of weighted residuals."""
    return float(residuals @ residuals) / len(residuals)


@dataclass(frozen=True)
class ScoredFit:
    """A fit with its costs on estimation and validation data [-].

    validation_blocks : sum of squares of each block of time of the validation data, shape (b,).
    samples_for_one : residuals of the validation data for each independent one: what a free run carries along, such as
    process noise or what the model lacks, lasts.
    """

    fit: Fit
    estimation_cost: float
    validation_cost: float
    validation_blocks: np.ndarray = field(default_factory=lambda: np.zeros(0))
    samples_for_one: float = 1.0

    @property
    def score(self) -> float:
        """Geometric mean of the two costs: small where both sets of recordings agree."""
        return math.sqrt(self.estimation_cost * self.validation_cost)


@dataclass(frozen=True)
class SearchProblem:
    """Estimation and validation data, pieces of the former, the parameters that may be freed late, settings, progress.

    progress : called with what is being done and the part of the step that is done. predictor_rate : of the predictor
    runs that count beside the free ones in the final fit [1/s]; 0 where no process noise shows. partial : whether only
    pieces of the estimation data are fitted, so that the end is a fit to all of them.
    """

    estimation: RecordingProblem
    validation: RecordingProblem
    estimation_pieces: RecordingProblem
    late: tuple[FreeParameter, ...]
    settings: SearchSettings
    progress: Progress
    predictor_rate: float = 0.0
    partial: bool = False

    @classmethod
    def of(
        cls,
        model: ModelStructure,
        estimation: Sequence[Record],
        validation: Sequence[Record],
        settings: SearchSettings,
        progress: Progress,
    ) -> SearchProblem:
        """The problem of recordings; without validation data the estimation data judge themselves.

        Of long recordings the search fits pieces.
        """
        fitted = windows(list(estimation), settings.search_seconds, settings.piece_seconds)
        pieces, held = windows(fitted, settings.piece_seconds), list(validation) or fitted
        whole, other, part = (RecordingProblem(records, model.simulator) for records in (fitted, held, pieces))
        partial = sum(len(r.commands) for r in fitted) < sum(len(r.commands) for r in estimation)
        return cls(whole, other, part, model.late, settings, progress, partial=partial)

    def fitted(
        self, free: FreeParameters, start: np.ndarray, evaluations: int, tolerance: float, *, near: bool = False
    ) -> ScoredFit:
        """A fit to the estimation data from `start`, scored; by way of the pieces where it is not `near` its end."""
        if near:
            return self.scored(fit(self.estimation, free, start, evaluations=evaluations, tolerance=tolerance))
        pieces = self.estimation_pieces
        least = self.settings.remaining_above**2 * pieces.noise_cost()
        way = predictor_start(pieces, free, start, evaluations=evaluations, tolerance=tolerance, near=least)
        return self.scored(arrived(self.estimation, free, way, evaluations=evaluations, tolerance=tolerance))

    def roughly(self, free: FreeParameters, start: np.ndarray, *, near: bool = False) -> ScoredFit:
        """A fit to the pieces that ends early, scored on all data: it shows whether a model is far worse."""
        led = fit if near else approached
        result = led(self.estimation_pieces, free, start, evaluations=FIRST, tolerance=ROUGH)
        return self.scored(linearised(self.estimation, result))

    def converged_again(self, model: ScoredFit) -> ScoredFit:
        """A model fitted to these data from where it stands."""
        return self.converged_from(model.fit.free, model.fit.x)

    def converged_from(self, free: FreeParameters, start: np.ndarray) -> ScoredFit:
        """A fit to these data from near its end, until it gains no more."""
        return self.fitted(free, start, self.settings.converging_evaluations, self.settings.converged, near=True)

    def scored(self, result: Fit) -> ScoredFit:
        """A fit with its costs, that of the validation data block by block as well."""
        r = self.validation_residuals(result.vector)
        blocks = np.bincount(self.validation.blocks(), r**2)
        alone = self.validation.samples_for_one(r)
        return ScoredFit(result, mean_square(result.residuals), mean_square(r), blocks, alone)

    def with_predictor(self, model: Fit) -> SearchProblem:
        """The same, with predictor runs beside the free ones where equal commands show process noise."""
        ratio = process_noise([self.estimation, self.validation], model.vector, self.settings.near_noise**2)
        if ratio is None:
            return self
        return replace(
            self,
            predictor_rate=INJECTION,
            estimation=self.estimation.unpredicted(ratio),
            validation=self.validation.unpredicted(ratio),
            estimation_pieces=self.estimation_pieces.unpredicted(ratio),
        )

    def again(self, model: ScoredFit) -> ScoredFit:
        """The same solution on these data."""
        return self.scored(linearised(self.estimation, model.fit))

    def on_predictor_runs(self, model: Fit) -> SearchProblem:
        """The same with predictor runs in place of the free ones where process noise shows; itself elsewhere."""
        if self.predictor_rate <= 0.0:
            return self
        parts = self.estimation, self.validation, self.estimation_pieces
        first, second, pieces = (p.predictor(self.predictor_rate) for p in parts)
        ratio = process_noise([first, second], model.vector, 0.0) or 1.0
        first, second, pieces = (p.unpredicted(ratio) for p in (first, second, pieces))
        return replace(self, estimation=first, validation=second, estimation_pieces=pieces)

    def refitted(self, current: ScoredFit) -> ScoredFit:
        """A fit of free runs, or where process noise shows one of free and predictor runs together from there."""
        if self.predictor_rate <= 0.0:
            return current
        both = FreeAndPredictor(self.estimation, self.predictor_rate, current.fit.vector)
        most, tolerance = self.settings.converging_evaluations, self.settings.converged
        result = fit(both, current.fit.free, current.fit.x, evaluations=most, tolerance=tolerance)
        return self.scored(linearised(self.estimation, result))

    def validation_residuals(self, vector: np.ndarray) -> np.ndarray:
        """Weighted residuals of a parameter vector on the validation data, at the null shifts that leave least."""
        return np.nan_to_num(self.validation.residuals(self.validation.centred(vector)[None, :])[0], nan=LOST)

    def with_nuisances(self, nuisances: NuisanceEstimates) -> SearchProblem:
        """The problem with nuisance parameters applied to its recordings."""
        return replace(
            self,
            estimation=nuisances.problem(self.estimation),
            validation=nuisances.problem(self.validation),
            estimation_pieces=nuisances.problem(self.estimation_pieces),
        )

    def on_whole(self, estimation: Sequence[Record]) -> SearchProblem:
        """The same problem with all of the estimation data."""
        whole = RecordingProblem(list(estimation), self.estimation.model).unpredicted(self.estimation.unpredictable)
        return replace(self, estimation=whole, partial=False)
