"""Drive-file iteration with a model: the next run's command comes from a model that is fitted to the last run.

A run is played under the model feedforward of the virtual table, and its recording (the command that acted, position,
acceleration) is what an identification needs: the parameters of the declared model and of the effects that it is to
have are fitted to the error of the free run, from the last model and from each trial of an effect, whichever start is
the closest. The motion that was missed so moves the inverse of the table and not the reference; where the model can
become the table, one run is enough. Correcting the reference of `iteration.drive` needs a table that answers nearly
linearly, which one with a soft zone does not. Not in the thesis.
Verified against: the simulated table, with models wrong by known amounts.

`lacking` runs `close_loop` on the first and the last run: what the model of the iteration lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.search_settings import SearchSettings
from shake_ros.core.discovery.unlisted_functions import UNLISTED
from shake_ros.core.identification.fit import fit
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError
from shake_ros.declared import model_structure, search_settings
from shake_ros.iteration.drive import Iteration, converged, error_in_band
from shake_ros.search import close_loop as closing

Array = NDArray[np.float64]
EVALUATIONS = 20  # trial points of a fit, at most; it starts near its end after the first run


def starts(free: FreeParameters, effects: Sequence[CandidateEffect]) -> Array:
    """The model as it is, and the model with each trial of each effect that it does not have yet, (m, p)."""
    rows = [free.start()]
    for effect in effects:
        if free.base.value(effect.strength.name) == effect.neutral:
            rows += [free.x_of(trial) for trial in effect.trials]
    return np.array(rows)


def refit(
    model: TableParameters, free: Sequence[FreeParameter], effects: Sequence[CandidateEffect], records: Sequence[Record]
) -> TableParameters:
    """The model fitted to recordings.

    Parameters
    ----------
    model : where the fit starts.
    free : its parameters that may move.
    effects : whose parameters may move as well.
    records : with acceleration.

    Raises
    ------
    ShakeError : a recording without acceleration, or none at all.
    """
    if not records or any(record.acceleration is None for record in records):
        raise ShakeError("iteration: the model needs recordings with acceleration")
    moved = FreeParameters(model, free).extended([p for effect in effects for p in effect.free])
    problem = RecordingProblem(list(records))
    rows = starts(moved, effects)
    costs = [np.mean(np.square(row)) for row in problem.residuals(moved.vectors(rows))]
    start = rows[int(np.argmin(np.nan_to_num(costs, nan=np.inf)))]
    return moved.table(fit(problem, moved, start, evaluations=EVALUATIONS).x)


def iterate_model(
    wanted: Array,
    model: TableParameters,
    play: Callable[[TableParameters, int], Record],
    learn: Callable[[TableParameters, Sequence[Record]], TableParameters],
    parameters: Iteration,
) -> tuple[list[TableParameters], list[float], str]:
    """Run after run until `converged`, each under the model fitted to the run before.

    Parameters
    ----------
    wanted : (n,) acceleration [m/s²].
    model : of the first run.
    play : plays the motion under the feedforward of this model in the run of this number and returns its recording.
    learn : the next model from this one and the recordings of a run, such as `refit`.

    Returns
    -------
    (models, errors, reason) : one of each a run; the best run is that of the least error
    """
    models, errors = [model], list[float]()
    while True:
        record = play(models[-1], len(errors))
        if record.acceleration is None or len(record.acceleration) != len(wanted):
            raise ShakeError("iteration: a run needs the acceleration of every sample of the wanted motion")
        errors.append(error_in_band(wanted, record.acceleration, record.sample_time, parameters))
        reason = converged(errors, parameters)
        if reason:
            return models, errors, reason
        models.append(learn(models[-1], [record]))


def lacking(
    model: TableParameters,
    runs: Sequence[Record],
    settings: SearchSettings | None = None,
    progress: ProgressOption = True,
) -> str:
    """Which effect a model lacks, in a sentence, from at least two runs; the first is fitted, the last one judges.

    Parameters
    ----------
    model : of the feedforward.
    runs : with acceleration, oldest first.
    settings : of the search, where not those of config/discovery/search.yaml.
    """
    if len(runs) < 2:
        return "one run does not show what the model lacks; close_loop needs two"
    with Progress("close_loop on the runs", progress) as bar:
        found = closing.close_loop(
            model_structure(model), runs[:1], runs[-1:], settings or search_settings(), bar
        ).verdicts
    if not found:
        return (
            "close_loop on the runs finds nothing missing from the model: the gains do not suit this table; ./shake "
            "tune makes new ones"
        )
    names = [s.effect for s in found if s.effect != UNLISTED]
    effects = ", ".join(f"{s.effect} ({s.place}{_or(s.alternatives)})" for s in found)
    text = f"close_loop on the runs: the model lacks {effects}"
    return f"{text}; --refit {' '.join(names)} fits it to the runs" if names else text


def _or(alternatives: Sequence[str]) -> str:
    """Effects that the runs cannot distinguish from one."""
    return f"; or {', '.join(alternatives)}" if alternatives else ""
