"""The first stages of a fit to recordings of a table without a data sheet.

The best first guesses are fitted briefly to pieces of the recordings, with the filter behind the accelerometer that
leaves least. The null shift of each recording is free in these fits, and stands in the recordings at their end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters, null_shifts_of
from shake_ros.fit.least_squares import Fit, fit
from shake_ros.fit.nuisances.estimates import NuisanceEstimates, estimated_null_shifts
from shake_ros.fit.nuisances.explained_band import explained_band
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.nuisances.sensor_filter import behind_filter, better_filter
from shake_ros.fit.nuisances.sensor_pair import SensorPair, pressed_in_time
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import windows
from shake_ros.fit.start.linear_table import SpecimenMode, moved_ahead
from shake_ros.fit.start.narrow_valleys import arrived, predictor_start, with_lag_parted
from shake_ros.fit.start.unknown_model import FirstGuess, UnknownModel
from shake_ros.physics.plant.parameters import TableParameters

PIECES, PIECE = 18.0, 6.0  # of the recordings that the first fit sees, and length of each [s]
GUESSES = 2  # that are fitted
SHAKEN_GUESSES = 6  # the same where noise in the table hides its ringing, which leaves more than one way to explain it
EVALUATIONS, TOLERANCE = 20, 1e-3  # of a first fit
ROUGH = 5e-3  # tolerance where it ends far from the noise, and of the predictor runs before
SAME = 0.99  # part of the cost of predictor runs from which a second guess leads nowhere else
HIGH_RATIO = 5.0  # ratio of the residual to the noise from which a first fit ends rough
ParametersOf = Callable[[TableParameters], Mapping[str, Sequence[FreeParameter]]]  # of effects, by their names
BETWEEN_SENSORS = ("accelerometer_lag", "position_sensor_lag", "accelerometer_scale", "base_flexibility")
SPECIMEN = "specimen_resonance"
SHOWN = (SPECIMEN, *BETWEEN_SENSORS)  # effects that show without a search
LEAST_SCALE = 0.02  # error of the accelerometer's scale that counts as one: smaller ones are those of a calibration


@dataclass(frozen=True)
class StartingPoint:
    """Where the whole fit begins.

    table : the declared one, fitted to pieces. data : recordings with the null shifts that it tells. shown : effects
    that sensors and linear response show without a search; `fitted` is the table with them.
    unbent : the declared one with the friction that it had before any fit.
    between : those of them that the sensors show, as they differ: whatever else moves the table moves both.
    """

    table: TableParameters
    data: Prepared
    fitted: TableParameters
    unbent: TableParameters
    shown: tuple[str, ...] = ()
    between: tuple[str, ...] = ()

    @classmethod
    def declared(cls, table: TableParameters, data: Prepared) -> StartingPoint:
        """A declared table, from which the fit begins as it is."""
        return cls(table, data, table, table)


def staged_start(
    model: UnknownModel,
    free: Sequence[FreeParameter],
    effects: ParametersOf,
    data: Prepared,
    progress: Callable[[str, float], None] = lambda *_: None,
) -> StartingPoint:
    """Where the whole fit begins, for a table of which little is known.

    Parameters
    ----------
    free : parameters that a fit may move. effects : the parameters of those that a table may lack.
    progress : called with what is being done and the part of it that is done.
    """
    progress("first guess from the recordings", 0.0)
    assert model.table is not None
    data = data.with_nuisances(NuisanceEstimates(behind_filter(data.estimation, data.sensors)))
    if (band := explained_band(data.estimation)) < np.inf:
        progress(f"the command explains nothing of the acceleration above {band:.3g} Hz: compared below", 0.0)
        data = data.below(band)
    free = [*free, *null_shifts_of(len({r.run for r in data.estimation}), free)]
    first = _first_fit(model, free, effects, data, progress)
    early = not data.ahead and quicker_than_sensor(first.best.table, data.delay)
    if early and not pressed_in_time(data.estimation, data.delay):
        progress("first fit: the position may be early, not the acceleration late", 0.0)
        moved = moved_ahead(data, data.delay, pressure=True)
        other = _first_fit(model, free, effects, moved, progress, first.mode)
        first = min(first, other, key=attrgetter("best.cost"))
    data, pieces, best, shown = first.data, first.pieces, first.best, first.shown
    between = tuple(e for e in shown if e in BETWEEN_SENSORS)
    if shown:
        progress(f"best so far: {' + '.join(shown)}, from the frequency responses", 0.0)
    if not leaves_much(pieces, best):
        best = with_lag_parted(pieces, best, TOLERANCE)
    table, shifts = best.table, estimated_null_shifts(model, best, data.estimation, data.validation)
    unbent = with_friction_of(first.guess, table, model).without(shown)
    data = data.with_nuisances(NuisanceEstimates(shifts=shifts))
    return StartingPoint(table.without(shown), data, table, unbent, shown, between)


@dataclass(frozen=True)
class _FirstFit:
    """The fit from the first guess, and that. shown : the effects that it has. mode : of its specimen."""

    data: Prepared
    pieces: RecordingProblem
    guess: TableParameters
    best: Fit
    shown: tuple[str, ...]
    mode: SpecimenMode | None


def _first_fit(
    model: UnknownModel,
    free: Sequence[FreeParameter],
    effects: ParametersOf,
    data: Prepared,
    progress: Callable[[str, float], None],
    mode: SpecimenMode | None = None,
) -> _FirstFit:
    """The best fit from a first guess, with the effects that the frequency responses show.

    mode : of a specimen that shows otherwise.
    """
    assert model.table is not None
    first = FirstGuess(data.estimation, data.sensors, mode)
    may_lack = tuple(effect for effect in SHOWN if model.may_lack(effect))

    def shown_on(table: TableParameters) -> dict[str, float]:
        return effects_between_sensors(table, data.sensors, may_lack)

    guesses = first.tables(model.table, model.unknown, model, shown_on, SPECIMEN in may_lack)
    known = effects(guesses[0])
    shown = tuple(e for e in SHOWN if e in known and e in guesses[0].effects)
    moved = [*free, *(p for effect in shown for p in known[effect])]
    progress("first fit", 0.0)
    pieces = _pieces(model, data)
    if data.estimation[0].explained is None:
        best = _best_of(pieces, moved, guesses[:GUESSES])
    else:
        # free runs alone: one that the sensors correct would follow what shakes the table beside the command
        few = RecordingProblem(windows(data.estimation, PIECE, PIECE), model)
        starts = [FreeParameters(guess, moved) for guess in guesses[:SHAKEN_GUESSES]]
        begun = [fit(few, f, f.start(), evaluations=EVALUATIONS, tolerance=TOLERANCE) for f in starts]
        best = _finished(pieces, min(begun, key=attrgetter("cost")))
    if (behind := better_filter(pieces, best)) is not None:
        data = data.with_nuisances(NuisanceEstimates(behind))
        pieces = _pieces(model, data)
        best = _best_of(pieces, moved, (best.table,))
    return _FirstFit(data, pieces, guesses[0], best, shown, first.linear.specimen)


def quicker_than_sensor(table: TableParameters, delay: float) -> bool:
    """Whether command and valve take less time than the accelerometer is late by: rather, the position is early."""
    valve = 2.0 * table.value("valve.damping") / table.value("valve.natural_frequency")
    return table.value("effects.command_delay.delay") + valve < delay


def leaves_much(pieces: RecordingProblem, found: Fit) -> bool:
    """Whether a fit leaves so much above the noise that its end tells nothing."""
    return 2.0 * found.cost >= HIGH_RATIO**2 * pieces.noise_cost() * pieces.count


def effects_between_sensors(table: TableParameters, sensors: SensorPair, may_lack: Sequence[str]) -> dict[str, float]:
    """Values, by dotted name, of the effects on a table that show between its sensors, among those that it may lack."""
    base, scale = sensors.base, sensors.scale_error
    shown = dict[str, float]()
    if sensors.lag:
        shown["effects.accelerometer_lag.time_constant"] = sensors.lag
    if sensors.position_lag:
        shown["effects.position_sensor_lag.time_constant"] = sensors.position_lag
    if scale is not None and abs(scale) > LEAST_SCALE:
        shown["effects.accelerometer_scale.error"] = scale
    if base is not None:
        shown |= base.on(table)
    return {name: value for name, value in shown.items() if name.split(".")[1] in may_lack}


def with_friction_of(guess: TableParameters, table: TableParameters, model: UnknownModel) -> TableParameters:
    """A table with the friction of a first guess, per mass, where it is unknown.

    Friction bends first where an effect is missing, and a fit may end in that valley.
    """
    heavier = table.moved_mass / guess.moved_mass
    values = {
        name: guess.value(name) * (heavier if "N" in guess.fields[name].metadata["unit"] else 1.0)
        for name in model.unknown
        if name.startswith("friction.")
    }
    return table.with_values(values)


def _pieces(model: UnknownModel, data: Prepared) -> RecordingProblem:
    """What the first fits see."""
    return RecordingProblem(windows(data.estimation, PIECES, PIECE), model)


def _best_of(pieces: RecordingProblem, free: Sequence[FreeParameter], guesses: Sequence[TableParameters]) -> Fit:
    """The best of short fits to pieces; none is made from a guess whose predictor runs end no better than another's."""
    best: Fit | None = None
    least = np.inf
    for guess in guesses:
        parameters = FreeParameters(guess, free)
        way = predictor_start(pieces, parameters, parameters.start(), evaluations=EVALUATIONS, tolerance=ROUGH)
        if best is None or way.predictor_cost < SAME * least:
            found = arrived(pieces, parameters, way, evaluations=EVALUATIONS, tolerance=ROUGH)
            best = found if best is None else min(best, found, key=attrgetter("cost"))
        least = min(least, way.predictor_cost)
    assert best is not None
    return best if leaves_much(pieces, best) else _finished(pieces, best)


def _finished(pieces: RecordingProblem, found: Fit) -> Fit:
    """A rough fit at its end."""
    done = fit(pieces, found.free, found.x, evaluations=EVALUATIONS, tolerance=TOLERANCE)
    return done.after(found.evaluations)
