"""The declared model fitted to recordings: by free runs, or (a force-driven axis) by its inverse dynamics.

Errors are those of free-running simulations from the recorded command, relative to the measured signal.

Some parameters are freed late, only once they explain much of what a model leaves above the noise. How dry friction
passes through rest (its transition velocity and sharpness) shows at every reversal, but weakly. Free from the start, it
would bend to whatever else the model lacks; kept for ever, it would leave a residual that other effects explain in its
place: of a small quake, turbulent leakage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from shake_ros.fit.axis_model import InverseDynamics
from shake_ros.fit.free_parameters import FreeParameters, is_of_recording
from shake_ros.fit.least_squares import Fit, fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.uncertainty import Estimate, estimates, form_errors
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.search.problem import ModelStructure, Progress, ScoredFit, SearchProblem
from shake_ros.search.search_settings import SearchSettings

Errors = dict[str, dict[str, float]]


@dataclass(frozen=True)
class FittedModel:
    """A fitted model; estimation, validation, test : relative errors of its free runs by recording and channel."""

    fit: Fit
    table: TableParameters
    parameters: tuple[Estimate, ...]
    estimation: Errors
    validation: Errors
    test: Errors = field(default_factory=dict)


def fitted_model(
    result: Fit, estimation: RecordingProblem, validation: RecordingProblem | None, blocks: np.ndarray | None = None
) -> FittedModel:
    """Parameters with standard errors, errors of the free runs.

    Parameters
    ----------
    blocks : of the fit's residuals, where they are not those of the estimation data.
    """
    vector = result.vector
    return FittedModel(
        result,
        result.table,
        tuple(
            estimates(result, estimation.blocks(), form_errors(estimation, result))
            if blocks is None
            else estimates(result, blocks)
        ),
        estimation.errors(vector),
        validation.errors(vector) if validation else {},
    )


def unassessed_model(result: Fit) -> FittedModel:
    """Parameters without standard errors, where neither these nor errors of free runs could be computed."""
    values = result.free.values(result.x).tolist()
    own = [(f, value) for f, value in zip(result.free.free, values, strict=True) if not is_of_recording(f.name)]
    return FittedModel(result, result.table, tuple(Estimate(f.name, v, None, f.unit) for f, v in own), {}, {})


def fit_declared(problem: SearchProblem, free: FreeParameters, lacking: bool = False) -> ScoredFit:
    """Fit the declared model; only roughly where it lacks something, or is fitted to more data at the end."""
    problem.progress("fitting the declared model", 0.0)
    settings = problem.settings
    if lacking or problem.partial:
        return problem.fitted(free, free.start(), settings.continued_evaluations, settings.continued_tolerance)
    return problem.fitted(free, free.start(), settings.converging_evaluations, settings.converged)


def with_late_parameters(problem: SearchProblem, current: ScoredFit) -> ScoredFit:
    """The fit with the late parameters freed as well, where they take much of what stands above the noise; else as is.

    The cost on the validation data must fall too.
    """
    settings, late = problem.settings, [p for p in problem.late if p.name not in current.fit.free.names]
    above = current.estimation_cost - problem.estimation.noise_cost()
    if above <= 0.0 or not late:
        return current
    free = current.fit.free.extended(late)
    start = np.append(current.fit.x, free.start()[-len(late) :])
    tried = problem.converged_from(free, start)
    helps = current.estimation_cost - tried.estimation_cost > settings.late_gain * above
    return tried if helps and tried.validation_cost < current.validation_cost else current


def declared_model(problem: SearchProblem, model: ModelStructure, lacking: bool = False) -> ScoredFit:
    """The declared model as of `fit_declared`, with its late parameters where they help."""
    return with_late_parameters(problem, fit_declared(problem, FreeParameters(model.table, model.free), lacking))


def identify(
    model: ModelStructure,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    settings: SearchSettings,
    progress: Progress,
) -> FittedModel:
    """Fit a declared model to estimation data; errors on them and on validation data.

    The validation data take no part in the fit: which parameters are freed late is decided on the estimation data.
    """
    problem = SearchProblem.of(model, estimation, (), settings, progress)
    found = declared_model(problem, model)
    if problem.partial:
        progress("final fit to all estimation data", 0.9)
        problem = problem.on_whole(estimation)
        found = problem.converged_again(found)
    held = RecordingProblem(list(validation), model.simulator) if validation else None
    return fitted_model(found.fit, problem.estimation, held)


def identify_inverse(
    model: ModelStructure, estimation: Sequence[Record], validation: Sequence[Record], settings: SearchSettings
) -> FittedModel:
    """Fit a force-driven axis by its inverse dynamics; errors are those of free runs all the same."""
    inverse, free = InverseDynamics(list(estimation)), FreeParameters(model.table, model.free)
    result = fit(inverse, free, free.start(), tolerance=settings.converged)
    held = RecordingProblem(list(validation), model.simulator) if validation else None
    return fitted_model(result, RecordingProblem(list(estimation), model.simulator), held, inverse.blocks())
