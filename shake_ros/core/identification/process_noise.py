"""Process noise: what no command tells, shown by equal commands; and fits to free and predictor runs where it acts.

What two stretches under equal commands leave differently is no fault of the model. A free run carries all of it along,
so its sum of squares is mostly chance and its residuals last; a predictor run forgets it within 1/rate. Each of the two
is weighted by its own size and by how few of its samples are independent,

    w = 1/√(m τ),   m : mean square,   τ = 1 + 2 Σ_k ρ(k)² : samples for each independent one,

with ρ the autocorrelation (Bartlett's formula), so that neither drowns the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.identification.fit import is_smooth
from shake_ros.core.identification.predictability import sensor_noise
from shake_ros.core.identification.recording_problem import BLOCK, RecordingProblem
from shake_ros.core.identification.repeats import repeats

Floats = NDArray[np.float64]
BEYOND = 3.0  # standard errors by which the difference must stand above the sensor noise


def process_noise(problems: Sequence[RecordingProblem], vector: np.ndarray, least: float) -> float | None:
    """What differs between equal commands over the sensor noise, both as weighted mean squares [-]; None below `least`.

    None as well where no command repeats, where it may be chance, and where runs cannot be corrected.

    Parameters
    ----------
    problems : over all recordings. vector : parameters of a table whose residuals are compared, so that what a loop
        around the table changes of the command does not count. least : ratio from which it is process noise.
    """
    if not all(problem.model.injects for problem in problems):
        return None
    records = [(p, k) for p in problems for k in range(len(p.records))]
    driven = [p.records[k].commands[p.records[k].start :] for p, k in records]
    pairs = repeats(driven, [p.records[k].sample_time for p, k in records])
    differing, noise = list[float](), list[float]()
    for pair in pairs:
        (p, k), (other, j) = records[pair.first], records[pair.second]
        here, there = _weighted(p, k, vector), _weighted(other, j, vector)
        channels = min(len(here), len(there))
        squares = np.zeros(pair.here.stop - pair.here.start)
        for (a, _), (b, _) in zip(here[:channels], there[:channels], strict=True):
            change = a[pair.here] - b[pair.there]
            squares += 0.5 * (change - np.mean(change)) ** 2
        count = max(len(squares) // max(round(BLOCK / p.records[k].sample_time), 1), 1)
        differing += [float(np.mean(block)) for block in np.array_split(squares, count)]
        noise += [sum(alone for _, alone in here[:channels])] * count
    if len(differing) < 3:
        return None
    scatter = float(np.std(differing, ddof=1)) / math.sqrt(len(differing))
    shown = float(np.mean(differing)) > least * float(np.mean(noise)) + BEYOND * scatter
    return float(np.mean(differing) / np.mean(noise)) if shown else None


def _weighted(problem: RecordingProblem, number: int, vector: np.ndarray) -> list[tuple[Floats, float]]:
    """Weighted residuals of one record by channel, with the mean square that sensor noise leaves of each."""
    record = problem.records[number]
    velocity, acceleration = problem.simulate(vector[None, :], record)
    w_v, w_a = problem.velocity_weights[number], problem.acceleration_weights[number]
    found = [(w_v * (record.velocity - velocity[0])[record.start :], (w_v * sensor_noise(record, "velocity")) ** 2)]
    if record.acceleration is not None:
        left = w_a * record.acceleration_left(acceleration[0])
        found.append((left, (w_a * sensor_noise(record, "acceleration")) ** 2))
    return found


def samples_for_one(residuals: Floats, reach: int) -> float:
    """Samples for each independent one, 1 + 2 Σ ρ², over lags up to `reach`, tapered.

    >>> white = np.random.default_rng(1).standard_normal(20000)
    >>> round(samples_for_one(white, 100), 1)
    1.0
    """
    e = residuals - np.mean(residuals)
    reach = min(reach, len(e) - 1)
    product = np.fft.irfft(np.abs(np.fft.rfft(e, 2 * len(e))) ** 2)[: reach + 1]
    if product[0] <= 0.0:
        return 1.0
    taper = 1.0 - np.arange(1, reach + 1) / (reach + 1.0)
    chance = 1.0 / len(e)  # of the square of a correlation
    return float(1.0 + 2.0 * np.sum(taper * (np.square(product[1:] / product[0]) - chance)))


class FreeAndPredictor:
    """A problem whose residuals are those of the free and the predictor runs of another, see above for their weights.

    Parameters
    ----------
    problem : of free runs. rate : at which its runs are corrected [1/s]. vector : parameters at which both are weighed.
    """

    def __init__(self, problem: RecordingProblem, rate: float, vector: np.ndarray) -> None:
        self.parts = problem, problem.predictor(rate)
        self.weights = [_weight(problem, part.residuals(vector[None, :])[0]) for part in self.parts]

    @property
    def smooth(self) -> bool:
        """Whether its residuals change with the parameters without small jumps."""
        return is_smooth(self.parts[0])

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals, shape (m, 2 n)."""
        rows = [w * part.residuals(vectors) for part, w in zip(self.parts, self.weights, strict=True)]
        return np.concatenate(rows, axis=1)


def _weight(problem: RecordingProblem, residuals: Floats) -> float:
    """1/√(m τ) of all residuals, τ their mean over records and channels by their squares."""
    squares, lasting, first = 0.0, 0.0, 0
    for record in problem.records:
        n = len(record.commands) - record.start
        for _ in range(1 if record.acceleration is None else 2):
            part, first = residuals[first : first + n], first + n
            square = float(part @ part)
            squares += square
            lasting += square * samples_for_one(part, round(BLOCK / record.sample_time))
    return 1.0 / math.sqrt(max(lasting / len(residuals), 1e-300)) if squares > 0.0 else 1.0
