"""What the reference shows of a table: its numbers, the levels of noise, and how much windows scatter.

The numbers of the file are a prior. All of them that the motion shows are fitted together by linearisations of every
window at one common estimate, with the levels of noise and the filter behind the accelerometer renewed on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import SENSOR_FILTER, TABLE, FreeModel
from shake_ros.fit.nuisances.sensor_filter import CUTOFFS
from shake_ros.fit.prediction import LIMITS, Predictor
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment
from shake_ros.physics.plant.sensors import FILTER_DELAY
from shake_ros.twin.change import KnownState, pooled
from shake_ros.twin.evidence import QUIET, WindowEvidence, evidence, segment_of

FEW = 3  # windows, from the loudest to the calmest, that show the levels of noise and where the parameters about lie
LEVELS = ("force", "acceleration", "position", "memory")
MEMORIES = (0.1, 0.03, 0.01)  # of the random force that are tried [s]
HELD = {"null": 1e-6, "null_drift": 1e-6, "bias": 1e-6, "bias_drift": 1e-7}  # offsets, which are followed instead
STEPS, CONVERGED = 4, 1.0  # linearisations of the few and of all at most; foreseen gain at which they end [nats]


def fitted_to(
    records: Sequence[Record], model: FreeModel, file: np.ndarray, loudness: float
) -> tuple[FreeModel, Levels, list[WindowEvidence]]:
    """A model fitted to the windows of a reference, with the levels of noise and the evidence of each window.

    The levels are sought where a few windows have led the model, under levels that leave room for its errors.

    Parameters
    ----------
    file : covariance of the parameters before, shape (p, p). loudness : as in `evidence`.
    """
    order = sorted(records, key=lambda r: Segment.of(r).loudness)
    few = [order[i] for i in np.linspace(0, len(order) - 1, min(FEW, len(order))).astype(int)]
    segments, levels = [segment_of(r) for r in few], Levels(force=0.05, memory=0.01, acceleration=0.5 / QUIET, **HELD)
    first, precision = KnownState(model.x, file), np.linalg.inv(file)
    found = list[WindowEvidence]()
    for windows in (few, records):
        levels = noise_levels(segments, model, levels) if found else levels
        model = with_filter(segments[len(segments) // 2], model, levels)
        for _ in range(STEPS):
            found = [evidence(model, r, levels, precision, loudness) for r in windows]
            known = pooled(first, found, 1.0)
            moved = np.clip(known.mean, *model.bounds) - model.x
            model = model.at(known.mean)
            if 0.5 * float(moved @ np.linalg.solve(known.covariance, moved)) < CONVERGED:
                break
    return model, levels, found


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
    begin = _likeliest_memory(few[len(few) // 2], vector, begin)
    own = Predictor(few, begin).tuned(vector, LEVELS)
    same = Predictor(steady, own.levels).tuned(vector, LEVELS)
    least = same.levels.force * usual
    if np.sum(same.log_likelihood()) > np.sum(own.log_likelihood()):
        return replace(same.levels, force=LIMITS["force"][0], least_force=least)
    return replace(own.levels, least_force=own.levels.force * usual)


def _likeliest_memory(segment: Segment, vector: np.ndarray, begin: Levels) -> Levels:
    """The likeliest of levels with a force of long or short memory.

    What a recording shows above its motion is noise of the sensor or a force of short memory. The likelihood has a
    maximum for each, and the parameters are biased at the wrong one.
    """
    kinds = [Predictor([segment], replace(begin, memory=m)).tuned(vector, ("force", "acceleration")) for m in MEMORIES]
    return max(kinds, key=lambda k: float(np.sum(k.log_likelihood()))).levels


def with_filter(segment: Segment, model: FreeModel, levels: Levels) -> FreeModel:
    """The model with the filter of the accelerometer, or none, under which a segment is likeliest."""
    if SENSOR_FILTER.name not in model.names:
        return model
    i, dt = model.names.index(SENSOR_FILTER.name), segment.dt
    tried = [0.0, *(FILTER_DELAY * dt / c for c in CUTOFFS), *([model.value(SENSOR_FILTER.name)] if model.x[i] else [])]
    models = [model.at(np.where(np.arange(len(model.x)) == i, lag / model.scale[i], model.x)) for lag in tried]
    likelihood = [np.sum(Predictor([segment], levels).filtered(m.vectors(m.x)[0]).log_likelihood()) for m in models]
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
