"""What the reference shows of a table: its numbers, the levels of noise, and how much windows scatter.

The numbers of the file are a prior. All of them that the motion shows are fitted together by linearisations of every
window at one common estimate, with the levels of noise and the filter behind the accelerometer renewed on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.sensor_filter import CUTOFFS
from shake_ros.core.plant.sensors import FILTER_DELAY
from shake_ros.fit.model import SENSOR_FILTER, TABLE, FreeModel
from shake_ros.fit.prediction import LIMITS, Levels, Predictor, tuned
from shake_ros.fit.segment import Segment
from shake_ros.twin.change import KnownState, pooled
from shake_ros.twin.evidence import WindowEvidence, evidence

TUNED = 4  # windows that show the levels of noise
LEVELS = ("force", "acceleration", "position", "memory")
HELD = {"null": 1e-6, "null_drift": 1e-6, "bias": 1e-6, "bias_drift": 1e-7}  # offsets, which are followed instead
STEPS, CONVERGED = 6, 1.0  # linearisations at most; foreseen gain at which they have converged [nats]
RENEWED = (0, 1, 3)  # linearisations before which levels of noise and the accelerometer's filter are sought


def fitted_to(records: Sequence[Record], model: FreeModel, file: np.ndarray) -> tuple[FreeModel, Levels, KnownState]:
    """A model fitted to the windows of a reference, with the levels of noise and what is known of its parameters.

    Parameters
    ----------
    file : covariance of the parameters before, shape (p, p).
    """
    few = [Segment.of(r) for r in records[:: max(len(records) // TUNED, 1)]]
    first, levels = KnownState(model.x, file), Levels(force=0.05, memory=0.1, **HELD)
    known, precision = first, np.linalg.inv(file)
    for step in range(STEPS):
        if step in RENEWED:
            levels = noise_levels(few, model, levels)
            model = with_filter(few, model, levels) if step else model
        found = [evidence(model, r, levels, precision, rounds=1) for r in records]
        known = pooled(first, found, 1.0)
        moved = np.clip(known.mean, *model.bounds) - model.x
        model = model.at(known.mean)
        if 0.5 * float(moved @ np.linalg.solve(known.covariance, moved)) < CONVERGED and step > RENEWED[1]:
            break
    return model, levels, known


@dataclass(frozen=True)
class _Steady(Segment):
    """A segment whose random force is not in proportion to its own motion, but to that of others [m/s²]."""

    usual: float = 1.0

    @property
    def loudness(self) -> float:  # type: ignore[override]
        """Root mean square of the acceleration of the others [m/s²]."""
        return self.usual


def noise_levels(few: Sequence[Segment], model: FreeModel, begin: Levels) -> Levels:
    """The levels of noise of a model; its random force is the same in all motions, or in proportion to them."""
    vector, usual = model.vectors(model.x)[0], float(np.median([s.loudness for s in few]))
    steady = [_Steady(**{f.name: getattr(s, f.name) for f in fields(s)}, usual=usual) for s in few]
    begin = replace(begin, force=max(begin.force, begin.least_force / usual), least_force=0.0)
    own, same = (tuned(Predictor(s, begin), vector, LEVELS) for s in (few, steady))
    least = same.levels.force * usual
    if np.sum(same.log_likelihood()) > np.sum(own.log_likelihood()):
        return replace(same.levels, force=LIMITS["force"][0], least_force=least)
    return replace(own.levels, least_force=own.levels.force * usual)


def with_filter(few: Sequence[Segment], model: FreeModel, levels: Levels) -> FreeModel:
    """The model with the filter of the accelerometer, or none, under which the segments are likeliest."""
    if SENSOR_FILTER.name not in model.names:
        return model
    i, dt = model.names.index(SENSOR_FILTER.name), few[0].dt
    tried = [0.0, *(FILTER_DELAY * dt / c for c in CUTOFFS), *([model.value(SENSOR_FILTER.name)] if model.x[i] else [])]
    models = [model.at(np.where(np.arange(len(model.x)) == i, lag / model.scale[i], model.x)) for lag in tried]
    likelihood = [np.sum(Predictor(few, levels).filtered(m.vectors(m.x)[0]).log_likelihood()) for m in models]
    return models[int(np.argmax(likelihood))]


def held(model: FreeModel, p: int) -> FreeModel:
    """A model of whose free parameters the first p remain so, and the others keep their values."""
    sensor = model.vectors(model.x)[0, TABLE:]
    return replace(model, table=model.found_table(), free=model.free[:p], x=model.x[:p], sensor=tuple(sensor.tolist()))


def scatter(windows: Sequence[WindowEvidence]) -> float:
    """Variance of the innovations by which windows scatter about their mean; their own mean square at least."""
    every = np.sum([w.information for w in windows], axis=0)
    scale = np.sqrt(np.maximum(np.diag(every), 1e-12))
    inner = np.linalg.pinv(every / np.outer(scale, scale), rcond=1e-9, hermitian=True)
    mean = inner @ (np.sum([w.vector for w in windows], axis=0) / scale) / scale
    squares = 0.0
    for w in windows:
        score = (w.vector - w.information @ mean) / scale
        inverse = np.linalg.pinv(w.information / np.outer(scale, scale), rcond=1e-9, hermitian=True)
        squares += float(score @ inverse @ score)
    shown = int(np.linalg.matrix_rank(inner, hermitian=True))
    least = float(np.mean([w.square for w in windows]))
    return max(squares / (max(len(windows) - 1, 1) * shown), least)
