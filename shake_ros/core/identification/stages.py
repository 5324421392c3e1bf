"""The first stages of a fit to recordings of a table without a data sheet.

The best first guesses are fitted briefly to pieces of the recordings; then the null shift of each recording is read off
the free run over the whole of it, whose mean velocity it moves, and what is left of the fit begins from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shake_ros.core.identification.first_guess import FirstGuess
from shake_ros.core.identification.fit import fit
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters
from shake_ros.core.identification.identified import velocity_gain
from shake_ros.core.identification.nuisances import Nuisance, Prepared
from shake_ros.core.identification.recordings import Record, RecordingProblem, low_pass, windows
from shake_ros.core.identification.unknown_model import UnknownModel
from shake_ros.core.plant.parameters import TableParameters

PIECES, PIECE = 24.0, 6.0  # of the recordings that the first fit sees, and length of each [s]
GUESSES = 2  # that are fitted
EVALUATIONS, TOLERANCE = 20, 1e-3  # of a first fit
ROUNDS = 2  # of null shifts and fit


def staged_start(
    model: UnknownModel, free: Sequence[FreeParameter], data: Prepared
) -> tuple[TableParameters, Prepared]:
    """Where the whole fit begins: a table, and the recordings with the null shifts that it tells."""
    assert model.table is not None
    given, lag = model.table, "effects.accelerometer_lag.time_constant"
    named = lag not in (*model.unknown, *model.deviations) and given.value(lag) == 0.0
    if named:  # what the sensors alone tell helps the first fits; the search has still to name it
        given = given.with_values({lag: data.accelerometer_lag})
    guesses = FirstGuess(data.estimation).tables(given, model.unknown, model)[:GUESSES]
    table = min((_fitted(model, free, guess, data) for guess in guesses), key=lambda found: found[0])[1]
    for _ in range(ROUNDS - 1):
        data = recentred(model, table, data)
        table = _fitted(model, free, table, data)[1]
    data = recentred(model, table, data)
    return (table.without(("accelerometer_lag",)) if named else table), data


def _fitted(
    model: UnknownModel, free: Sequence[FreeParameter], start: TableParameters, data: Prepared
) -> tuple[float, TableParameters]:
    """Cost and table of a short fit to pieces."""
    parameters = FreeParameters(start, free)
    problem = RecordingProblem(windows(data.estimation, PIECES, PIECE), model)
    found = fit(problem, parameters, parameters.start(), evaluations=EVALUATIONS, tolerance=TOLERANCE)
    return found.cost, parameters.table(found.x)


def recentred(model: UnknownModel, table: TableParameters, data: Prepared) -> Prepared:
    """The recordings with the null shifts at which the free run of a table has the measured mean velocity."""
    gain = velocity_gain(table)
    shifts: dict[str, float] = {}
    for name in dict.fromkeys(r.name for r in (*data.estimation, *data.validation)):
        parts = [r for r in (*data.estimation, *data.validation) if r.name == name]
        left = np.concatenate([_velocity_left(model, table, r) for r in parts])
        largest = 0.05 * max(float(np.max(np.abs(r.commands))) for r in parts)
        shifts[name] = float(np.clip(np.mean(left) / gain, -largest, largest))

    def moved(record: Record) -> Record:
        shift = shifts[record.name]
        return replace(record, commands=record.commands + shift, standing=record.standing + shift)

    offsets = tuple(
        Nuisance(n.recording, n.null_shift + shifts[n.recording], n.acceleration_bias) for n in data.nuisances
    )
    return replace(
        data,
        estimation=[moved(r) for r in data.estimation],
        validation=[moved(r) for r in data.validation],
        nuisances=offsets,
    )


def _velocity_left(model: UnknownModel, table: TableParameters, record: Record) -> np.ndarray:
    """Measured less simulated velocity [m/s]."""
    simulated = low_pass(model.run(table, record)[:, 1], record.sample_time)
    return np.asarray((record.velocity - simulated)[record.start :])
