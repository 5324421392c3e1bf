"""Equal commands, and the process noise that they show; fits to free and predictor runs where it acts.

A model that the command alone drives answers equal commands alike, so what differs between two answers no such model
can have. Of two signals a and b under equal commands, each without its mean,

    repeats : mean of a b        differs : mean of (a − b)²/2        and the two add up to the mean square.

Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach (2012), 4.3, for two periods.

A free run carries process noise along, so its sum of squares is mostly chance and its residuals last; a predictor run
forgets it within 1/rate. Each of the two is weighted by its own size and by how few of its samples are independent,

    w = 1/√(m τ),   m : mean square,   τ : samples for each independent one (signals/noise.py),

so that neither drowns the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.fit.least_squares import is_smooth
from shake_ros.fit.recording_problem import BLOCK, RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.signals.multisine_split import repeated_period
from shake_ros.signals.noise import white_deviation
from shake_ros.signals.velocity_filter import velocity_noise_gain

Floats = NDArray[np.float64]
SHORTEST = 1.0  # stretch of an equal command that shows something [s]
ALIKE = 0.15  # change relative to the command up to which it is equal: a residual is without what the model makes of it
MOST = 30  # recordings that are compared with each other: of more, each is compared with itself alone
LEAST_OVERLAP = 0.5  # of the shorter of two recordings, below which stretches are alike by chance
BEYOND = 3.0  # standard errors by which the difference must stand above the sensor noise


@dataclass(frozen=True)
class Repeat:
    """Two stretches under the same command: of recordings `first` and `second`, which may be one and the same."""

    first: int
    second: int
    here: slice
    there: slice


def repeats(commands: Sequence[Floats], sample_times: Sequence[float]) -> list[Repeat]:
    """All pairs of stretches with equal commands: neighbouring periods of one recording, and pairs of recordings.

    Parameters
    ----------
    commands : of each recording, shape (n,). sample_times : of each [s]; only equal ones are compared.

    >>> u = np.random.default_rng(1).standard_normal(3000)
    >>> [(r.first, r.second, r.there.start) for r in repeats([u[:2000], u[500:]], [1e-3, 1e-3])]
    [(0, 1, 0)]
    """
    found = []
    for i, u in enumerate(commands):
        period = repeated_period(u, change=ALIKE)
        if period is not None and (len(u) - period) * sample_times[i] >= SHORTEST:
            first = min(max(len(u) - 2 * period, 0), period)  # a first period settles, where two follow it
            found.append(Repeat(i, i, slice(first, len(u) - period), slice(first + period, len(u))))
        for j in range(i + 1, len(commands) if len(commands) <= MOST else 0):
            pair = _overlap(u, commands[j]) if sample_times[i] == sample_times[j] else None
            if pair is not None and (pair[0].stop - pair[0].start) * sample_times[i] >= SHORTEST:
                found.append(Repeat(i, j, *pair))
    return found


def _overlap(a: Floats, b: Floats) -> tuple[slice, slice] | None:
    """The stretches of two commands that are alike once shifted to where they correlate most; None where none are."""
    size = 2 ** int(np.ceil(np.log2(len(a) + len(b))))
    product = np.fft.irfft(np.fft.rfft(a - a.mean(), size) * np.conj(np.fft.rfft(b - b.mean(), size)), size)
    lag = int(np.argmax(product))  # a[k + lag] is b[k]
    lag = lag - size if lag > size // 2 else lag
    first, second = max(lag, 0), max(-lag, 0)
    count = min(len(a) - first, len(b) - second)
    if count < LEAST_OVERLAP * min(len(a), len(b)):
        return None
    here, there = slice(first, first + count), slice(second, second + count)
    change, scale = float(np.std(a[here] - b[there])), float(np.std(a[here]))
    return (here, there) if 0.0 < scale and change < ALIKE * scale else None


def repeated_and_different(a: Floats, b: Floats) -> tuple[float, float]:
    """Mean square of what two signals share and of what differs between them [unit²]; their means do not count.

    >>> a, b = np.array([1.0, -1.0, 3.0, -3.0]), np.array([1.0, -1.0, 1.0, -1.0])
    >>> repeated_and_different(a, b)
    (2.0, 1.0)
    """
    a, b = a - np.mean(a), b - np.mean(b)
    return float(np.mean(a * b)), float(0.5 * np.mean((a - b) ** 2))


def sensor_noise(record: Record, channel: str) -> float:
    """Standard deviation of the white noise of a channel, whatever the command repeats.

    What changes from period to period (`Record.velocity_noise`) holds process noise too; here the two are apart.
    """
    if channel == "velocity":
        return velocity_noise_gain(record.sample_time) * record.position_noise()
    assert record.acceleration is not None
    return min(white_deviation(record.acceleration), record.calmest)


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
        channels = [channel for channel in here if channel in there]
        squares = np.zeros(pair.here.stop - pair.here.start)
        for channel in channels:
            change = here[channel][0][pair.here] - there[channel][0][pair.there]
            squares += 0.5 * (change - np.mean(change)) ** 2
        count = max(len(squares) // max(round(BLOCK / p.records[k].sample_time), 1), 1)
        differing += [float(np.mean(block)) for block in np.array_split(squares, count)]
        noise += [sum(here[channel][1] for channel in channels)] * count
    if len(differing) < 3:
        return None
    scatter = float(np.std(differing, ddof=1)) / math.sqrt(len(differing))
    shown = float(np.mean(differing)) > least * float(np.mean(noise)) + BEYOND * scatter
    return float(np.mean(differing) / np.mean(noise)) if shown else None


def _weighted(problem: RecordingProblem, number: int, vector: np.ndarray) -> dict[str, tuple[Floats, float]]:
    """Weighted residuals of one record by channel, with the mean square that sensor noise leaves of each."""
    record = problem.records[number]
    velocity, acceleration = problem.simulate(vector[None, :], record)
    w_v, w_a = problem.velocity_weights[number], problem.acceleration_weights[number]
    found = dict[str, tuple[Floats, float]]()
    if record.position_measured:
        left = w_v * (record.velocity - velocity[0])[record.start :]
        found["velocity"] = left, (w_v * sensor_noise(record, "velocity")) ** 2
    if record.acceleration is not None:
        left = w_a * record.acceleration_left(acceleration[0])
        found["acceleration"] = left, (w_a * sensor_noise(record, "acceleration")) ** 2
    return found


class FreeAndPredictor:
    """A problem whose residuals are those of the free and the predictor runs of another, see above for their weights.

    Parameters
    ----------
    problem : of free runs. rate : at which its runs are corrected [1/s]. vector : parameters at which both are weighed.
    """

    def __init__(self, problem: RecordingProblem, rate: float, vector: np.ndarray) -> None:
        self.parts = problem, problem.predictor(rate)
        self.weights = []
        for part in self.parts:
            r = part.residuals(vector[None, :])[0]
            square = float(np.mean(r**2)) * problem.samples_for_one(r)
            self.weights.append(1.0 / math.sqrt(square) if square > 0.0 else 1.0)

    @property
    def smooth(self) -> bool:
        """Whether its residuals change with the parameters without small jumps."""
        return is_smooth(self.parts[0])

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals, shape (m, 2 n)."""
        rows = [w * part.residuals(vectors) for part, w in zip(self.parts, self.weights, strict=True)]
        return np.concatenate(rows, axis=1)
