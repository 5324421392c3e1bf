"""The search over sets of effects, on a table and its recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.given_answer import GivenAnswer
from shake_ros.core.discovery.problem import ModelStructure
from shake_ros.core.failures import RAISING, Failures
from shake_ros.core.identification.free_parameters import is_of_recording
from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.sensor_filter import SensorFilter, filter_of
from shake_ros.core.plant.parameters import FULL_LAYOUT
from shake_ros.explain.backlash import BACKLASH, shows_backlash, width_of_gap
from shake_ros.fit.likelihood import FreeRuns, Levels
from shake_ros.fit.model import SENSOR_DELAY, SENSOR_FILTER, FreeModel, TriedEffect, start_of
from shake_ros.fit.prediction import Predictor, SlowRuns
from shake_ros.fit.segment import Segment, pieces
from shake_ros.fit.solver import Budget
from shake_ros.search.candidates import listed
from shake_ros.search.loop import Scored, SearchData, SetSearch, Start

STIFFNESS = "effects.coupling_backlash.stiffness"
SECONDS, PIECE = 14.0, 3.5  # of the estimation data that are fitted, and length of each piece [s]
VALIDATION_SECONDS = 10.0  # of the validation data
GAP = 1.25  # times the width that the dwells show, from which a backlash starts: a dwell is noticed late
DECLARED = Levels(force=3.0, null=1e-6, null_drift=1e-6, bias=1e-6, bias_drift=1e-7)  # offsets are effects here
UNKNOWN = Levels(null=1e-4)  # the null shifts of whole recordings are in their commands by now


def answer(
    model: ModelStructure,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    budget: Budget,
    progress: Callable[[str], None],
    failures: Failures = RAISING,
) -> GivenAnswer:
    """The effects that a table lacks.

    Parameters
    ----------
    model : of a table, with its free parameters and the effects that it may lack.
    estimation, validation : recordings that are fitted, and recordings that choose between models.
    budget : how long it may take. progress : called with a line of progress.
    failures : takes an error of the search, which then ends with what it has found.
    """
    known = {c.effect: c for c in model.candidates}
    shown = None if BACKLASH in model.shown else backlash(known.get(BACKLASH), estimation)
    certain = (*model.between, *((BACKLASH,) if shown or BACKLASH in model.shown else ()))
    data = search_data(model, estimation, validation or estimation, BACKLASH in certain)
    search = SetSearch(data, [listed(c) for c in model.candidates], budget, progress, shown, certain)
    behind, unknown = filter_of(estimation[0]), model.simulator.nuisances
    begin = beginning(model, behind)
    models, others, done = list[Scored](), dict[str, list[Scored]](), False
    with failures.step("search"):
        for better in search.run(begin, UNKNOWN if unknown else DECLARED):
            models.append(better)
        others, done = search.rivals(models[-1]), not budget.over()
    rivals = {
        effect: tuple((known[m.model.effects[-1].name], m.model.found_table()) for m in found)
        for effect, found in others.items()
    }
    best = models[-1].model if models else begin
    sensor = found_filter(best, behind) if unknown else None
    return GivenAnswer(best.found_table(), tuple(known[c.name] for c in best.effects), rivals, not done, sensor)


def search_data(
    model: ModelStructure, estimation: Sequence[Record], validation: Sequence[Record], contacts: bool
) -> SearchData:
    """The recordings as the model is fitted to them: by free runs where no predictor follows it.

    contacts : whether the acceleration shows a backlash.
    """
    if model.simulator.layout is not FULL_LAYOUT:
        return SearchData(*(FreeRuns(r, model.simulator, Levels()) for r in (estimation, validation)))
    runs = SlowRuns if contacts else Predictor
    parts = pieces(estimation, SECONDS, PIECE), pieces(validation, VALIDATION_SECONDS, PIECE)
    return SearchData(*(runs([Segment.of(r) for r in part], Levels()) for part in parts))


def beginning(model: ModelStructure, behind: SensorFilter) -> FreeModel:
    """The model with the effects that show without a search, from which it begins.

    behind : delay and filter of the accelerometer, which are free where the table is unknown.
    """
    own = [p for p in (*model.free, *model.late) if not is_of_recording(p.name)]
    found = start_of(model.table, own)
    if model.simulator.nuisances:
        found = start_of(model.table, (*own, SENSOR_DELAY, SENSOR_FILTER))
        x = found.x.copy()
        x[-1] = behind.by_filter / SENSOR_FILTER.scale  # the delay beside it has been taken out of the recordings
        found = found.at(x)
    for c in model.candidates:
        if model.fitted is not None and c.effect in model.shown:
            values = {p.name: model.fitted.value(p.name) for p in c.free}
            found = found.with_effect(slow_one(c) if c.effect == BACKLASH else listed(c), values)
    return found


def found_filter(model: FreeModel, before: SensorFilter) -> SensorFilter:
    """Delay and filter of the accelerometer of a fitted model."""
    by_filter = model.value(SENSOR_FILTER.name)
    return SensorFilter(before.pure + model.value(SENSOR_DELAY.name) + by_filter, by_filter)


def slow_one(backlash: CandidateEffect) -> TriedEffect:
    """A backlash as slow motion shows it, which leaves the mass on the piston's side, its last parameter, open."""
    effect = listed(backlash)
    return replace(effect, free=effect.free[:-1])


def backlash(effect: CandidateEffect | None, records: Sequence[Record]) -> Start | None:
    """Start of a backlash that the acceleration shows; none where it shows none."""
    if effect is None or not shows_backlash(records):
        return None
    softest = min(effect.trials, key=lambda t: t[STIFFNESS])
    return Start(slow_one(effect), {**softest, effect.strength.name: GAP * width_of_gap(records)})
