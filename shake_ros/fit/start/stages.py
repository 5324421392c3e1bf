"""The first stages of a fit to recordings of a table without a data sheet.

The best first guesses are fitted briefly to pieces of the recordings, with the filter behind the accelerometer that
leaves least; where that leaves much, with backlash alone (narrow_valleys.py) or with several effects at once
(joint_start.py). The null shift of each recording is free in these fits, and stands in the recordings at their end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters, null_shifts_of
from shake_ros.fit.least_squares import Fit, costs, fit
from shake_ros.fit.nuisances.estimates import NuisanceEstimates, estimated_null_shifts
from shake_ros.fit.nuisances.explained_band import explained_band
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.nuisances.sensor_filter import behind_filter, better_filter
from shake_ros.fit.nuisances.sensor_pair import SensorPair
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import windows
from shake_ros.fit.start.joint_start import JoiningEffect, joint_start
from shake_ros.fit.start.linear_table import moved_ahead
from shake_ros.fit.start.narrow_valleys import FALL, arrived, from_slow_to_fast, predictor_start, slow, with_lag_parted
from shake_ros.fit.start.unknown_model import FirstGuess, UnknownModel
from shake_ros.fit.uncertainty import at_bound
from shake_ros.physics.plant.parameters import TableParameters

PIECES, PIECE = 18.0, 6.0  # of the recordings that the first fit sees, and length of each [s]
SLOW_PIECES, SLOW_PIECE = 9.0, 3.0  # the same of what a way from slow to fast motion sees [s]
GUESSES = 2  # that are fitted
SHAKEN_GUESSES = 6  # the same where noise in the table hides its ringing, which leaves more than one way to explain it
EVALUATIONS, TOLERANCE = 20, 1e-3  # of a first fit
ROUGH = 5e-3  # tolerance where it ends far from the noise, and of the predictor runs before
SAME = 0.99  # part of the cost of predictor runs from which a second guess leads nowhere else
HIGH_RATIO = 5.0  # ratio of the residual to the noise from which several effects are looked for at once
BOUND_RATIO = 2.0  # the same from which an effect on a bound is no finding
JOINED = 0.5  # part of the cost that these may leave
ALONE = 0.25  # the same of one alone from a narrow start that does not show at once
CERTAIN = 0.1  # part that they leave where they are certain but for a bound or much that is left
BEYOND = 0.03  # the same where they are beyond any
JOINTS = 3  # times that they are looked for
EffectsOf = Callable[[TableParameters], Mapping[str, JoiningEffect]]
BETWEEN_SENSORS = ("accelerometer_lag", "position_sensor_lag", "accelerometer_scale", "base_flexibility")
SPECIMEN = "specimen_resonance"
SHOWN = (SPECIMEN, *BETWEEN_SENSORS)  # effects that show without a search
LEAST_SCALE = 0.02  # error of the accelerometer's scale that counts as one: smaller ones are those of a calibration


@dataclass(frozen=True)
class StartingPoint:
    """Where the whole fit begins.

    table : the declared one, fitted to pieces. data : recordings with the null shifts that it tells. shown : effects
    that sensors, linear response and a fit with many effects show without a search; `fitted` is the table with them.
    between : those of them that the sensors show, as they differ: whatever else moves the table moves both.
    """

    table: TableParameters
    data: Prepared
    fitted: TableParameters
    shown: tuple[str, ...] = ()
    between: tuple[str, ...] = ()

    @classmethod
    def declared(cls, table: TableParameters, data: Prepared) -> StartingPoint:
        """A declared table, from which the fit begins as it is."""
        return cls(table, data, table)


def staged_start(
    model: UnknownModel,
    free: Sequence[FreeParameter],
    effects: EffectsOf,
    data: Prepared,
    progress: Callable[[str, float], None] = lambda *_: None,
) -> StartingPoint:
    """Where the whole fit begins, for a table of which little is known.

    Parameters
    ----------
    free : parameters that a fit may move. effects : that a table may lack. progress : called with what is being done
        and the part of it that is done.
    """
    progress("first guess from the recordings", 0.0)
    assert model.table is not None
    data = data.with_nuisances(NuisanceEstimates(behind_filter(data.estimation, data.sensors)))
    if (band := explained_band(data.estimation)) < np.inf:
        progress(f"the command explains nothing of the acceleration above {band:.3g} Hz: compared below", 0.0)
        data = data.below(band)
    free = [*free, *null_shifts_of(len({r.run for r in data.estimation}), free)]
    first = _first_fit(model, free, effects, data, progress)
    if not data.ahead and quicker_than_sensor(first.best.table, data.delay):
        progress("first fit: the position may be early, not the acceleration late", 0.0)
        other = _first_fit(model, free, effects, moved_ahead(data, data.delay), progress)
        first = min(first, other, key=attrgetter("best.cost"))
    data, pieces, best, known, shown = first.data, first.pieces, first.best, first.known, first.shown
    between = tuple(e for e in shown if e in BETWEEN_SENSORS)
    if shown:
        progress(f"best so far: {' + '.join(shown)}, from the frequency responses", 0.0)

    def moved(names: Sequence[str]) -> list[FreeParameter]:
        return with_effects(free, known, names)

    begin = first.guess
    for _ in range(JOINTS):
        if not leaves_much(pieces, best):
            break
        progress("first fit: several effects at once", 0.0)
        joined, more = several_at_once(pieces, moved(shown), known, begin, best, progress)
        if joined.cost > JOINED * best.cost:
            break
        best, shown, begin = joined, (*shown, *more), joined.table  # what is left shows others better
        over = residual_to_noise_ratio(pieces, best)
        progress(f"best so far: {' + '.join(shown)}, {over:.1f} × the noise in segments of the estimation data", 0.0)
    if residual_to_noise_ratio(pieces, best) >= BOUND_RATIO and not any(known[e].narrow for e in shown):
        progress("first fit: refitting friction", 0.0)
        anew = _fitted(pieces, moved(shown), with_friction_of(first.guess, best.table, model))
        best = min(best, anew, key=attrgetter("cost"))
    if not leaves_much(pieces, best):
        best = with_lag_parted(pieces, best, TOLERANCE)
    table, shifts = best.table, estimated_null_shifts(model, best, data.estimation, data.validation)
    return StartingPoint(
        table.without(shown), data.with_nuisances(NuisanceEstimates(shifts=shifts)), table, shown, between
    )


@dataclass(frozen=True)
class _FirstFit:
    """The fit from the first guess. known : the effects that the table may lack. shown : those that it has."""

    data: Prepared
    pieces: RecordingProblem
    guess: TableParameters
    best: Fit
    known: Mapping[str, JoiningEffect]
    shown: tuple[str, ...]


def _first_fit(
    model: UnknownModel,
    free: Sequence[FreeParameter],
    effects: EffectsOf,
    data: Prepared,
    progress: Callable[[str, float], None],
) -> _FirstFit:
    """The best fit from a first guess, with the effects that the frequency responses show."""
    assert model.table is not None
    first = FirstGuess(data.estimation, data.sensors)
    may_lack = tuple(effect for effect in SHOWN if model.may_lack(effect))

    def shown_on(table: TableParameters) -> dict[str, float]:
        return effects_between_sensors(table, data.sensors, may_lack)

    guesses = first.tables(model.table, model.unknown, model, shown_on, SPECIMEN in may_lack)
    known = effects(guesses[0])
    shown = tuple(e for e in SHOWN if e in known and e in guesses[0].effects)
    moved = with_effects(free, known, shown)
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
        best = _fitted(pieces, moved, best.table)
    return _FirstFit(data, pieces, guesses[0], best, known, shown)


def quicker_than_sensor(table: TableParameters, delay: float) -> bool:
    """Whether command and valve take less time than the accelerometer is late by: rather, the position is early."""
    valve = 2.0 * table.value("valve.damping") / table.value("valve.natural_frequency")
    return table.value("effects.command_delay.delay") + valve < delay


def residual_to_noise_ratio(pieces: RecordingProblem, found: Fit) -> float:
    """Ratio of what a fit leaves to the noise [-]."""
    return float(np.sqrt(2.0 * found.cost / (pieces.noise_cost() * pieces.count)))


def leaves_much(pieces: RecordingProblem, found: Fit) -> bool:
    """Whether a fit leaves so much above the noise that several effects are looked for at once."""
    return residual_to_noise_ratio(pieces, found) >= HIGH_RATIO


def rests_on_bound(pieces: RecordingProblem, found: Fit) -> bool:
    """Whether an effect rests on a bound and much is left: it stands for one that is not there."""
    return residual_to_noise_ratio(pieces, found) >= BOUND_RATIO and any(
        name.startswith("effects.") for name, rests in zip(found.free.names, at_bound(found), strict=True) if rests
    )


def is_no_answer(pieces: RecordingProblem, joined: Fit, before: float) -> bool:
    """Whether the joint fit is no answer: it leaves more than CERTAIN of the cost, or BEYOND and much or at a bound."""
    left = joined.cost / before
    return left > CERTAIN or (left > BEYOND and (leaves_much(pieces, joined) or rests_on_bound(pieces, joined)))


def with_effects(
    free: Sequence[FreeParameter], known: Mapping[str, JoiningEffect], names: Sequence[str]
) -> list[FreeParameter]:
    """What a fit moves with these effects."""
    return [*free, *(p for e in names for p in known[e].free)]


def several_at_once(
    pieces: RecordingProblem,
    free: Sequence[FreeParameter],
    known: Mapping[str, JoiningEffect],
    begin: TableParameters,
    before: Fit,
    progress: Callable[[str, float], None] = lambda *_: None,
) -> tuple[Fit, tuple[str, ...]]:
    """The fit with the effects that hold where many are tried at once, and these; the one before where none does.

    An effect with narrow starts that shows at once is sought before: it stands where it leaves no more than JOINED of
    the cost before. Where the fit with many leaves much, friction with a memory may join as well. Where that is no
    answer yet, the fit from the best narrow start replaces it where it leaves less than JOINED of what that leaves, and
    than ALONE of the cost before: a stiff contact between two bodies follows much that it is not.
    """
    absent = {name: effect for name, effect in known.items() if name not in begin.effects}
    narrow = [name for name, effect in absent.items() if effect.narrow]
    at_once = [name for name in narrow if shows_at_once(pieces, known[name], before)]

    def alone(names: Sequence[str], most: float) -> tuple[Fit, tuple[str, ...]] | None:
        """The fit with the first of some effects that leaves no more than that from its best narrow start."""
        for name in names:
            progress(f"first fit: {name}, slow motion first", 0.0)
            moved = with_effects(free, known, (name,))
            found = from_narrow_start(pieces, moved, known[name], begin, before, most)
            if found is not None and found.cost <= most:
                return found, (name,)
        return None

    if (first := alone(at_once, JOINED * before.cost)) is not None:
        return first
    best, more = _joined(pieces, free, known, begin, before)
    if leaves_much(pieces, best) and any(effect.where_far for effect in absent.values()):
        far = _joined(pieces, free, known, begin, before, far=True)
        best, more = min((best, more), far, key=lambda found: found[0].cost)
    if is_no_answer(pieces, best, before.cost):
        others = [name for name in narrow if name not in at_once]
        return alone(others, min(JOINED * best.cost, ALONE * before.cost)) or (best, more)
    return best, more


def _joined(
    pieces: RecordingProblem,
    free: Sequence[FreeParameter],
    known: Mapping[str, JoiningEffect],
    begin: TableParameters,
    before: Fit,
    far: bool = False,
) -> tuple[Fit, tuple[str, ...]]:
    """The fit with the effects that hold where many are tried at once, and these; the one before where none does."""
    start, more = joint_start(pieces, free, known, begin, far)
    if not more:
        return before, more
    return _fitted(pieces, with_effects(free, known, more), start), more


def from_narrow_start(
    pieces: RecordingProblem,
    free: Sequence[FreeParameter],
    effect: JoiningEffect,
    begin: TableParameters,
    before: Fit,
    most: float,
) -> Fit | None:
    """The fit with one effect whose valley is too narrow to be met from its absence; None where it is hopeless.

    Backlash between rod and table is one: near nothing it is a rigid joint, and other effects smear its dwells.
    free : what the fit moves, with the effect's own parameters. begin, before : a first guess and the fit without the
    effect, from the better of which it sets out. most : cost that it may leave.
    """
    parameters = FreeParameters(begin.with_values(effect.narrow[0]), free)
    starts = [parameters.x_of(point) for point in effect.narrow] + list(narrow_starts(parameters, effect, before))
    few = RecordingProblem(windows(pieces.records, SLOW_PIECES, SLOW_PIECE), pieces.model)
    useful = most * few.count / pieces.count
    x = from_slow_to_fast(few, parameters, starts, [f.name for f in reversed(effect.free)], useful)
    if costs(pieces, parameters, x)[0] > FALL * most:
        return None
    return fit(pieces, parameters, x, evaluations=EVALUATIONS, tolerance=TOLERANCE)  # predictor runs would lead away


def narrow_starts(parameters: FreeParameters, effect: JoiningEffect, before: Fit) -> np.ndarray:
    """The effect's starts put on a fit without it as that stands, shape (m, p)."""
    rows = np.array([parameters.x_of(point) for point in effect.narrow])
    rows[:, [parameters.names.index(name) for name in before.free.names]] = before.x
    return rows


def shows_at_once(pieces: RecordingProblem, effect: JoiningEffect, before: Fit) -> bool:
    """Whether an effect lowers what a fit leaves of slow motion as soon as it is put on it and nothing else moved.

    Most backlash of some hundredths of a millimetre and more does, and no other effect that was tried.
    """
    slow_motion = slow(pieces)
    parameters = FreeParameters(before.table.with_values(effect.narrow[0]), [*before.free.free, *effect.free])
    with_it = costs(slow_motion, parameters, narrow_starts(parameters, effect, before))
    return bool(np.min(with_it) < costs(slow_motion, before.free, before.x[None, :])[0])


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

    Friction bends first where an effect is missing, and may stay in that valley once the effect is there.
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


def _fitted(pieces: RecordingProblem, free: Sequence[FreeParameter], start: TableParameters) -> Fit:
    """A short fit to pieces."""
    return _best_of(pieces, free, (start,))


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
