"""Innovations: how far a predictor errs at several rates of correction, and how far ahead.

A free run carries along what no command tells (process noise), a predictor forgets it (`inject` in
plant/integration.py). Where the model is right and nothing but the command drives the table, a predictor only lets
sensor noise in: each error is held against what sensor noise alone makes of the same run, which a run of the model
itself with noise added shows. Process noise makes a predictor run err less than that; a model that lacks something does
so too, so a predictor alone shows no process noise: equal commands do (fit/nuisances/equal_commands.py).

The measured velocity has passed a zero-phase filter and looks some 10 ms ahead: horizons below that are flattered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.fit.nuisances.equal_commands import sensor_noise
from shake_ros.fit.recording_problem import BLOCK, RecordingProblem
from shake_ros.fit.records import Record, windows
from shake_ros.signals.velocity_filter import derivative

Floats = NDArray[np.float64]
RATES = (0.0, 5.0, 10.0, 20.0, 40.0, 80.0)  # of correction [1/s]; 0: a free run
HORIZONS = (0.005, 0.02, 0.1)  # of prediction [s]
CORRECTED_FOR = 3.0  # times 1/rate that a run is corrected before each prediction
OFFSETS = 5  # predictions begin at so many places of the recording, evenly apart
SECONDS, PIECE = 12.0, 3.0  # of recordings, and of each piece of them, that are predicted [s]
HELPS = 0.8  # part of the free run's mean square, relative to the noise, from which a predictor helps …
BEYOND = 3.0  # … where it is beyond so many standard errors


@dataclass(frozen=True)
class Innovations:
    """Errors of prediction on held-out data.

    errors, by_noise : rms by channel over the sensor noise at each of RATES, and what sensor noise alone makes of it.
    relative : mean square of all weighted errors at each rate over that of sensor noise alone. best : rate at which
    that is least [1/s]. helps : whether a predictor at it helps beyond chance. horizons : rms by channel over the
    sensor noise at each of HORIZONS, for runs that were corrected until then.
    """

    errors: Mapping[str, tuple[float, ...]]
    by_noise: Mapping[str, tuple[float, ...]]
    relative: tuple[float, ...]
    best: float
    helps: bool
    horizons: Mapping[str, tuple[float, ...]]

    @property
    def text(self) -> str:
        """A phrase for a report."""
        k = RATES.index(self.best)
        if not self.helps:
            return "a predictor is no better than a free run: no sign of process noise"
        gain = math.sqrt(self.relative[0] / self.relative[k])
        return (
            f"a predictor with a gain of {self.best:g} 1/s errs {gain:.1f} times less than a free run, noise excluded; "
            "a missing effect would lead to that, and process noise too: repeated commands distinguish the two"
        )


def innovations(problem: RecordingProblem, vector: np.ndarray) -> Innovations | None:
    """Errors of prediction of a table over (pieces of) recordings.

    None of a model whose runs cannot be corrected, and where no position was measured.
    """
    if not problem.model.injects or not all(r.position_measured for r in problem.records):
        return None
    problem = RecordingProblem(windows(problem.records, SECONDS, PIECE), problem.model)
    true, noise = _errors(problem, vector, [r.motion for r in problem.records])
    made = [_with_noise(problem, vector, k) for k in range(len(problem.records))]
    alone, _ = _errors(problem, vector, made)
    costs = np.array([np.mean(np.concatenate([np.concatenate(e) for e in rate])) for rate in true])
    floors = np.array([np.mean(np.concatenate([np.concatenate(e) for e in rate])) for rate in alone])
    relative = costs / np.maximum(floors, 1e-300)
    k = int(np.argmin(relative))
    helps = k > 0 and _helps(problem, true[0], true[k], float(floors[0]), float(floors[k]))
    rate = RATES[k] or RATES[-2]
    channels = ["velocity", *(["acceleration"] if problem.records[0].acceleration is not None else [])]
    errors, by_noise = ({c: _residual_to_noise(e, noise, i) for i, c in enumerate(channels)} for e in (true, alone))
    ahead = _horizons(problem, vector, rate)
    horizons = {c: ahead[i] for i, c in enumerate(channels)}
    return Innovations(errors, by_noise, tuple(relative.tolist()), RATES[k], helps, horizons)


def _signals(record: Record, motion: Floats) -> list[tuple[Floats, float]]:
    """What a run is held against, channel by channel, and the sensor noise of each."""
    found = [(motion[:, 0], sensor_noise(record, "velocity"))]
    return found if record.acceleration is None else [*found, (motion[:, 1], sensor_noise(record, "acceleration"))]


def _errors(
    problem: RecordingProblem, vector: np.ndarray, motions: list[Floats]
) -> tuple[list[list[list[Floats]]], list[float]]:
    """Squares of the weighted errors by rate, record and channel; and the weighted mean square of noise by channel."""
    found = []
    weights = list(zip(problem.velocity_weights, problem.acceleration_weights, strict=True))
    for rate in RATES:
        predictor = problem.predictor(rate)
        rows = []
        for record, motion, weight in zip(problem.records, motions, weights, strict=True):
            simulated = predictor.simulate(vector[None, :], record.corrected_by(motion))
            pairs = zip(_signals(record, motion), simulated, weight, strict=False)
            left = [w * (wanted - s[0])[record.start :] for (wanted, _), s, w in pairs]
            rows.append([np.where(record.whole[record.start :], each, 0.0) ** 2 for each in left])
        found.append(rows)
    per_channel = []
    for i in range(len(found[0][0])):
        noise = [(w[i] * _signals(r, m)[i][1]) ** 2 for r, m, w in zip(problem.records, motions, weights, strict=True)]
        per_channel.append(float(np.mean(noise)))
    return found, per_channel


def _residual_to_noise(errors: list[list[list[Floats]]], noise: list[float], channel: int) -> tuple[float, ...]:
    """Rms over the sensor noise of one channel at each rate."""
    squares = [float(np.mean(np.concatenate([record[channel] for record in rate]))) for rate in errors]
    return tuple(math.sqrt(square / max(noise[channel], 1e-300)) for square in squares)


def _with_noise(problem: RecordingProblem, vector: np.ndarray, number: int) -> Floats:
    """The motion that sensors would show of the model's own free run, shape (n, 2)."""
    record, rng = problem.records[number], np.random.default_rng([number, 1])
    velocity, acceleration = problem.simulate(vector[None, :], record)
    n = len(record.commands)
    shaken = derivative(record.position_noise() * rng.standard_normal(n), record.sample_time)
    felt = np.full(n, np.nan)
    if record.acceleration is not None:
        felt = acceleration[0] + sensor_noise(record, "acceleration") * rng.standard_normal(n)
    return np.column_stack([velocity[0] + shaken, felt])


def _helps(
    problem: RecordingProblem,
    free: list[list[Floats]],
    predictor: list[list[Floats]],
    by_free: float,
    by_predictor: float,
) -> bool:
    """Whether a predictor helps beyond chance, block by block of time, each error over what noise makes of it."""
    gains, costs = [], []
    for record, before, after in zip(problem.records, free, predictor, strict=True):
        count = max(len(before[0]) // max(round(BLOCK / record.sample_time), 1), 1)
        then = np.mean(before, axis=0) / by_free
        gains += [float(np.mean(b)) for b in np.array_split(then - np.mean(after, axis=0) / by_predictor, count)]
        costs += [float(np.mean(b)) for b in np.array_split(then, count)]
    if len(gains) < 3 or np.mean(gains) < (1.0 - HELPS) * np.mean(costs):
        return False
    return bool(np.mean(gains) > BEYOND * np.std(gains, ddof=1) / math.sqrt(len(gains)))


def _horizons(problem: RecordingProblem, vector: np.ndarray, rate: float) -> list[tuple[float, ...]]:
    """Rms error over the sensor noise of each channel at HORIZONS after the run was left free."""
    predictor, squares = problem.predictor(rate), [[list[Floats]() for _ in HORIZONS] for _ in range(2)]
    cycle = CORRECTED_FOR / rate + HORIZONS[-1]
    for record in problem.records:
        time = np.arange(len(record.commands)) * record.sample_time
        for offset in np.arange(OFFSETS) * cycle / OFFSETS:
            since = (time + offset) % cycle - CORRECTED_FOR / rate  # the run was left free
            motion = np.where((since > 0.0)[:, None], np.nan, record.motion)
            simulated = predictor.simulate(vector[None, :], record.corrected_by(motion))
            for i, (wanted, noise) in enumerate(_signals(record, record.motion)):
                error = ((wanted - simulated[i][0]) / noise) ** 2
                for k, horizon in enumerate(HORIZONS):
                    near = np.abs(since - horizon) <= max(0.5 * record.sample_time, 0.1 * horizon)
                    near[: record.start] = False
                    near &= record.whole
                    squares[i][k].append(error[near])
    return [tuple(math.sqrt(float(np.mean(np.concatenate(s)))) for s in each) for each in squares if each[0]]
