"""The search over sets of effects, on a table and its recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from shake_ros.failures import RAISING, Failures
from shake_ros.fit.free_parameters import FreeParameter, is_of_recording
from shake_ros.fit.likelihood import FreeRuns, Levels, ShakenRuns
from shake_ros.fit.model import SENSOR, SENSOR_DELAY, SENSOR_FILTER, SENSOR_SCALE, FreeModel, TriedEffect, start_of
from shake_ros.fit.nuisances.estimates import NuisanceEstimates
from shake_ros.fit.nuisances.sensor_filter import SHORTEST_DELAY, filter_of
from shake_ros.fit.nuisances.sensor_pair import BASE, base_between
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.records import Record, windows
from shake_ros.fit.segment import Segment, pieces
from shake_ros.fit.slow_runs import SlowRuns
from shake_ros.fit.solver import Budget
from shake_ros.fit.start.backlash import BACKLASH, shows_backlash, width_of_gap
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.candidates import listed
from shake_ros.search.loop import Scored, SearchData, SetSearch, Start
from shake_ros.search.problem import ModelStructure
from shake_ros.search.selection import GivenAnswer

NULL_SHIFT = "effects.valve_null_shift.offset"  # what all recordings have in common of it
STIFFNESS = "effects.coupling_backlash.stiffness"
OF_POSITION = "position_sensor_lag"
LAGS = ("accelerometer_lag", OF_POSITION)
SECONDS, PIECE = 14.0, 3.5  # of the estimation data that are fitted, and length of each piece [s]
VALIDATION_SECONDS = 10.0  # of the validation data
GAP = 1.25  # times the width that the dwells show, from which a backlash starts: a dwell is noticed late
DECLARED = Levels(force=3.0, null_drift=1e-6, bias=1e-6, bias_drift=1e-7)  # offsets are effects here
UNKNOWN = Levels(null=0.01)


def answer(
    model: ModelStructure,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    budget: Budget,
    progress: Callable[[str], None],
    failures: Failures = RAISING,
    *,
    slow: bool = False,
) -> GivenAnswer:
    """The effects that a table lacks.

    Parameters
    ----------
    model : of a table, with its free parameters and the effects that it may lack.
    estimation, validation : recordings that are fitted, and recordings that choose between models.
    budget : how long it may take. progress : called with a line of progress.
    failures : takes an error of the search, which then ends with what it has found.
    slow : search with free runs of slow motion, even where nothing shows that no predictor follows the table.
    """
    known = {c.effect: c for c in model.candidates}
    shown = None if BACKLASH in model.shown else backlash(known.get(BACKLASH), estimation)
    certain = (*model.between, *((BACKLASH,) if shown or BACKLASH in model.shown else ()))
    slow = slow or BACKLASH in certain
    data = search_data(model, estimation, validation or estimation, slow)
    search = SetSearch(data, effects_tried(model, estimation, slow), budget, progress, shown, certain)
    unknown = model.simulator.nuisances
    filtered = unknown and isinstance(data.estimation, Predictor)
    pressure = pressure_scale(model.table, estimation) if unknown else None
    sensors = {} if pressure is None else {SENSOR_SCALE: pressure}
    by_filter = filter_of(estimation[0]).by_filter if filtered else 0.0
    if unknown and isinstance(data.estimation, SlowRuns) and estimation[0].position_measured:
        sensors |= {SENSOR_DELAY: 0.0, SENSOR_FILTER: by_filter}
    elif by_filter > 0.0:
        sensors |= {SENSOR_FILTER: by_filter}  # the first fit may have given it a sensor's lag
    begin = beginning(model, sensors, by_filter, apart=(NULL_SHIFT,) if filtered else ())
    models, others, done = list[Scored](), dict[str, list[Scored]](), False
    with failures.step("search"):
        for better in search.run(begin, UNKNOWN if unknown else DECLARED):
            models.append(better)
            names = better.model.effect_names
            if BACKLASH in names and not shown and set(names) != set(begin.effect_names):
                break  # no predictor follows its contacts, nor tells slow motion all: a fit of free runs comes first
        else:
            others = search.rivals(models[-1])
        done = not budget.over()
    rivals = {
        effect: tuple((known[m.model.effects[-1].name], m.model.found_table()) for m in instead)
        for effect, instead in others.items()
    }
    reduced = {} if not models else {e: m.model.found_table() for e, m in search.reduced(models[-1]).items()}
    best = models[-1].model if models else begin
    found = tuple(known[c.name] for c in best.effects)
    shifts = null_shifts(data, models[-1].data, [*estimation, *validation]) if models else {}
    behind = filter_of(estimation[0]).reformed(best.value(SENSOR_FILTER.name)) if by_filter > 0.0 else None
    nuisances = NuisanceEstimates(behind, shifts=shifts)
    return GivenAnswer(best.found_table(), found, rivals, reduced, not done, type(data.estimation), nuisances)


def null_shifts(begun: SearchData, found: SearchData, records: Sequence[Record]) -> dict[str, float]:
    """Null shift by recording, the mean of its segments' [-]; none of free runs."""
    more = dict[str, list[float]]()
    for before, after in ((begun.estimation, found.estimation), (begun.validation, found.validation)):
        if isinstance(before, Predictor) and isinstance(after, Predictor):
            for one, other in zip(before.segments, after.segments, strict=True):
                more.setdefault(one.name, []).append(float(other.commands[0] - one.commands[0]))
    return {r.name: r.shift + float(np.mean(more[r.name])) for r in records if r.name in more}


def search_data(
    model: ModelStructure, estimation: Sequence[Record], validation: Sequence[Record], slow: bool
) -> SearchData:
    """The recordings as the model is fitted to them: by a predictor, or by free runs where none follows it.

    No predictor has the noise of a table that something beside its command shakes. slow : free runs of slow motion.
    """
    if estimation[0].explained is not None:
        parts = windows([*estimation], SECONDS, PIECE), windows([*validation], VALIDATION_SECONDS, PIECE)
        return SearchData(*(ShakenRuns(part, model.simulator, Levels()) for part in parts))
    if model.simulator.layout is not FULL_LAYOUT:
        return SearchData(*(FreeRuns(r, model.simulator, Levels()) for r in (estimation, validation)))
    runs = SlowRuns if slow else Predictor
    parts = pieces(estimation, SECONDS, PIECE), pieces(validation, VALIDATION_SECONDS, PIECE)
    return SearchData(*(runs([Segment.of(r) for r in part], Levels()) for part in parts))


def beginning(
    model: ModelStructure, sensors: Mapping[FreeParameter, float], by_filter: float, apart: Sequence[str] = ()
) -> FreeModel:
    """The model with the effects that show without a search, from which it begins.

    Parameters
    ----------
    sensors : what is free of the sensors, with its value. by_filter : delay of the accelerometer's filter [s].
    apart : parameters that each segment has for itself.
    """
    own = [p for p in (*model.free, *model.late) if not is_of_recording(p.name) and p.name not in apart]
    found = start_of(model.table, (*own, *sensors))
    sensor = tuple({**SENSOR, SENSOR_FILTER.name: by_filter}.values())
    found = replace(found, table=model.unbent or model.table, sensor=sensor)
    found = found.at(np.concatenate([found.x[: len(own)], [value / p.scale for p, value in sensors.items()]]))
    for c in model.candidates:
        if model.fitted is not None and c.effect in model.shown:
            values = {p.name: model.fitted.value(p.name) for p in c.free}
            found = found.with_effect(tried(c, slow=True, fitted=True), values)  # beside backlash motion is slow
    return found


def pressure_scale(table: TableParameters, records: Sequence[Record]) -> float | None:
    """Load pressure measured, over what moves the mass of a table; None where none was measured."""
    both = [(r.pressure, r.acceleration) for r in records]
    sizes = [float(np.std(p) / np.std(a)) for p, a in both if p is not None and a is not None]
    if not sizes:
        return None
    return float(np.median(sizes)) * table.value("body.piston_area") / table.moved_mass


def effects_tried(model: ModelStructure, records: Sequence[Record], slow: bool) -> list[TriedEffect]:
    """The effects that a model may lack, tried also as they show: off its frequency a mode promises little.

    Those that the model begins with have the values of its first fit, and a base the mode that shows most between the
    sensors. On an unknown table a lag of less than a part of a sample may be the time between a recorder's channels.
    """
    shortest = SHORTEST_DELAY * records[0].sample_time if model.simulator.nuisances else 0.0

    def as_shown(effect: TriedEffect) -> TriedEffect:
        if model.fitted is None or effect.name not in model.shown:
            return effect
        return effect.with_trial({p.name: model.fitted.value(p.name) for p in effect.free})

    effects = [as_shown(tried(c, slow, c.effect in model.shown)) for c in model.candidates]
    effects = [e.with_least(shortest) if e.name in LAGS else e for e in effects]
    base = base_between(records) if any(e.name == BASE for e in effects) else None
    return effects if base is None else [e.with_trial(base.on(model.table)) if e.name == BASE else e for e in effects]


def tried(candidate: CandidateEffect, slow: bool, fitted: bool = False) -> TriedEffect:
    """An effect as the search tries it.

    Slow motion leaves a backlash's mass on the piston's side open, its last parameter; once fitted to all motion it
    keeps its stiffness, too.
    """
    effect = listed(candidate)
    if not slow or effect.name != BACKLASH:
        return effect
    return replace(effect, free=effect.free[:1] if fitted else effect.free[:-1])


def backlash(effect: CandidateEffect | None, records: Sequence[Record]) -> Start | None:
    """Start of a backlash that the acceleration shows; none where it shows none."""
    if effect is None or not shows_backlash(records):
        return None
    softest = min(effect.trials, key=lambda t: t[STIFFNESS])
    return Start(tried(effect, slow=True), {**softest, effect.strength.name: GAP * width_of_gap(records)})
