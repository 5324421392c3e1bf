"""Closing the loop with measured data: declared fit, search for the missing effect, what remains; one result.

Errors are those of free-running simulations from the recorded command, relative to the measured signal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.core.discovery.candidates import Candidate
from shake_ros.core.discovery.judging import Policy
from shake_ros.core.discovery.late import freed_late
from shake_ros.core.discovery.refits import CONVERGED, mean_square
from shake_ros.core.discovery.remaining import Remaining, remaining
from shake_ros.core.discovery.search import Search, search
from shake_ros.core.identification.axis_model import AXIS, InverseDynamics
from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.identification.free_parameters import Declared, FreeParameter, FreeParameters
from shake_ros.core.identification.recordings import FULL, Model, Record, RecordingProblem, windows
from shake_ros.core.identification.uncertainty import Estimate, estimates

Progress = Callable[[str, float], None]
Errors = dict[str, dict[str, float]]
FIRST_LOOK = 15.0  # seconds of recordings on which starts and candidates are first tried
STARTS = 48  # random starts of the declared fit
REFINED = 3  # best starts that are fitted


@dataclass(frozen=True)
class FittedModel:
    """A fitted model with the errors of its free runs on both sets of recordings."""

    fit: Fit
    table: Declared
    parameters: tuple[Estimate, ...]
    learn: Errors
    hold: Errors


@dataclass(frozen=True)
class ClosedLoop:
    """Result of closing the loop: models before and after, the steps between them, what remains."""

    baseline: FittedModel
    models: tuple[FittedModel, ...]
    search: Search
    remaining: Remaining
    noise: dict[str, float]
    model: Model = FULL

    @property
    def final(self) -> FittedModel:
        """The model after the last step."""
        return self.models[-1] if self.models else self.baseline


def random_starts(free: FreeParameters, count: int, seed: int = 0) -> np.ndarray:
    """Starts spread around the declared values: each parameter times a factor within 1/4 … 4, shape (count, p)."""
    rng = np.random.default_rng(seed)
    start = free.start()
    factors = 4.0 ** rng.uniform(-1.0, 1.0, (count, len(start)))
    factors[0] = 1.0
    sign = np.where(free.high <= 0.0, -1.0, 1.0)
    return np.asarray(np.clip(sign * np.maximum(sign * start, 1.0) * factors, free.low, free.high))


def fit_declared(problem: RecordingProblem, explore: RecordingProblem, free: FreeParameters, progress: Progress) -> Fit:
    """Fit the declared model from several starts."""
    progress("declared model: starts", 0.0)
    starts = random_starts(free, STARTS)
    starts[0] = free.start()
    rows = np.nan_to_num(explore.residuals(free.vectors(starts)), nan=1e3, posinf=1e3, neginf=-1e3)
    order = np.argsort([mean_square(r) for r in rows])
    chosen = dict.fromkeys([0, *order[:REFINED].tolist()])
    short = []
    for i, index in enumerate(chosen):
        progress("declared model: fit", (i + 1) / (len(chosen) + 2))
        short.append(fit(explore, free, starts[index], evaluations=12, tolerance=1e-3))
    best = min(short, key=lambda f: f.cost)
    progress("declared model: fit", (len(chosen) + 1) / (len(chosen) + 2))
    return fit(problem, free, best.x, evaluations=60, tolerance=CONVERGED)


def fitted_model(
    result: Fit, learn: RecordingProblem, hold: RecordingProblem | None, blocks: np.ndarray | None = None
) -> FittedModel:
    """Parameters with standard errors and free-run errors; `blocks` of the fit's residuals where not those of learn."""
    vector = result.free.vectors(result.x)[0]
    return FittedModel(
        result,
        result.free.table(result.x),
        tuple(estimates(result, learn.blocks() if blocks is None else blocks)),
        learn.errors(vector),
        hold.errors(vector) if hold else {},
    )


def identify(
    table: Declared,
    free: Sequence[FreeParameter],
    learn: list[Record],
    hold: list[Record],
    progress: Progress,
    model: Model = FULL,
    late: Sequence[FreeParameter] = (),
) -> FittedModel:
    """Fit the declared model to recordings; errors on them and on recordings held out.

    Parameters
    ----------
    free, late : its parameters that the fit may move, from the start or once the others have settled.
    """
    problem = RecordingProblem(learn, model)
    explore = RecordingProblem(windows(learn, FIRST_LOOK), model)
    result = fit_declared(problem, explore, FreeParameters(table, free), progress)
    result = freed_late(problem, None, result, late, Policy())
    return fitted_model(result, problem, RecordingProblem(hold, model) if hold else None)


def identify_inverse(
    table: Declared, free: Sequence[FreeParameter], learn: list[Record], hold: list[Record]
) -> FittedModel:
    """Fit a force-driven axis by its inverse dynamics; errors are those of free runs all the same."""
    inverse = InverseDynamics(learn)
    parameters = FreeParameters(table, free)
    result = fit(inverse, parameters, parameters.start(), tolerance=CONVERGED)
    held = RecordingProblem(hold, AXIS) if hold else None
    return fitted_model(result, RecordingProblem(learn, AXIS), held, inverse.blocks())


def close_loop(
    table: Declared,
    free: Sequence[FreeParameter],
    pool: tuple[Candidate, ...],
    learn: list[Record],
    hold: list[Record],
    policy: Policy,
    progress: Progress,
    model: Model = FULL,
    late: Sequence[FreeParameter] = (),
) -> ClosedLoop:
    """Find what the declared model lacks.

    Parameters
    ----------
    table : declared table. free : its parameters that a fit may move. pool : candidate effects.
    learn, hold : recordings to learn from and held out. progress : called with a text and the part done, 0 … 1.
    model : simulates the table. late : declared parameters freed once they explain much of what is left.
    """
    problem, held = RecordingProblem(learn, model), RecordingProblem(hold, model)
    explore = RecordingProblem(windows(learn, FIRST_LOOK), model)
    declared = fit_declared(problem, explore, FreeParameters(table, free), progress)
    explore_held = RecordingProblem(windows(hold, FIRST_LOOK), model)
    found = search(problem, held, declared, pool, policy, progress, explore, explore_held, late)
    progress("errors and what remains", 0.9)
    baseline, last = fitted_model(found.declared, problem, held), fitted_model(found.final, problem, held)
    gone = tuple(f"effects.{effect}." for effect in found.removed)
    models = []
    for step in found.steps:
        outdated = any(name.startswith(gone) for name in step.chosen.fit.free.names) if gone else False
        final = outdated or step is found.steps[-1]
        models.append(last if final else fitted_model(step.chosen.fit, problem, held))
    rest = remaining(held, found)
    return ClosedLoop(baseline, tuple(models), found, rest, problem.noise(), model)
