"""The free-running simulation error over several recordings (chapter 4, 6.3.3.2): what a fit makes small.

Open-loop positions drift, so velocity and acceleration are fitted. The simulated velocity goes through the filter that
the measured one has gone through (filtered against filtered). Of a force-driven axis the position is fitted as well: it
is what was measured, and a drift of its free run is that of the force. Where the pressures of both chambers were
measured their difference is fitted, but for its offset, and for its scale where the table's pressures have no unit.
Of a recording without a position neither position nor velocity is compared.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from shake_ros.fit.declared_model import FULL, Compared, DeclaredModel
from shake_ros.fit.least_squares import LOST
from shake_ros.fit.records import MODEL_FLOOR, Record, relative_error
from shake_ros.physics.plant.simulation import workers
from shake_ros.signals.noise import samples_for_one
from shake_ros.signals.velocity_filter import filtered_velocity, independent_part, low_pass

BLOCK = 0.5  # length of a block of time for standard errors [s], shorter where the recordings would give less than
BLOCKS = 24  # blocks in all: with fewer, the scatter of the blocks tells too little of itself
NULL_ROUNDS = 3  # of looking for a null shift
NULL_STEP, NULL_MOST = 1e-4, 2e-3  # step of its difference, and how far one round moves it at most [-]
CALM = 0.3  # weight of what rings beyond the band: it is narrow, so that most of its samples repeat others
HIGHEST = 0.4  # of the sampling rate, above which a band takes nothing away


class RecordingProblem:
    """Weighted free-running simulation error over several recordings.

    Each channel is weighted by its noise, with a floor relative to its size; velocity counts with the number of its
    independent samples in the filter's band. The samples of a measured position are independent.
    """

    def __init__(self, records: list[Record], model: DeclaredModel = FULL) -> None:
        self.records = records
        self.model = model
        self.injection = 0.0
        self.unpredictable = 1.0
        self.band = math.inf
        self.difference: float | None = None
        self.velocity_weights = []
        self.acceleration_weights = []
        self.position_weights = []
        self.pressure_weights = []
        for r in records:
            independent = independent_part(r.sample_time, r.every)
            velocity, acceleration = r.deviations()
            self.velocity_weights.append(np.sqrt(independent) / velocity if velocity else 0.0)
            self.acceleration_weights.append(1.0 / acceleration if acceleration else 0.0)
            if model.positions:
                floor = MODEL_FLOOR * float(np.std(r.position[r.start :]))
                self.position_weights.append(1.0 / np.hypot(r.position_noise(), floor))
            else:
                self.position_weights.append(0.0)
            self.pressure_weights.append(1.0 / r.pressure_deviation() if self._compares_pressure(r) else 0.0)

    @property
    def smooth(self) -> bool:
        """Whether its residuals change with the parameters without small jumps."""
        return self.model.smooth

    def predictor(self, injection: float) -> RecordingProblem:
        """The same with runs that are corrected towards the measurement at a rate [1/s], where the model can."""
        if not self.model.injects:
            return self
        problem = copy.copy(self)
        problem.injection = injection
        return problem

    def below(self, band: float, difference: float) -> RecordingProblem:
        """The same with what its residuals have below a frequency [Hz], and a difference step of its own."""
        problem = copy.copy(self)
        problem.band, problem.difference = band, difference
        return problem

    def unpredicted(self, ratio: float) -> RecordingProblem:
        """The same where process noise and sensor noise together are so many times the sensor noise's mean square."""
        problem = copy.copy(self)
        problem.unpredictable = ratio
        return problem

    def simulate(self, vectors: np.ndarray, record: Record) -> tuple[np.ndarray, np.ndarray]:
        """Filtered velocity and acceleration of one recording, each of shape (m, n)."""
        found = self._compared(vectors, record)
        return found.velocity, found.acceleration

    def _compared(self, vectors: np.ndarray, record: Record) -> Compared:
        velocity, acceleration, position, pressure = self.model.compared(vectors, record, self.injection)
        velocity = filtered_velocity(velocity, record.sample_time)
        seen = np.arange(len(record.commands)) >= record.start
        if self.model.nuisances:
            velocity = self._with_offset(velocity, record.velocity, seen)
            if record.acceleration is not None:
                acceleration = self._with_offset(acceleration, record.acceleration, seen & record.whole)
        if pressure is not None and record.pressure is not None:
            if self.model.nuisances:  # pressures in a gauge of their own
                centred = record.in_band(pressure - np.mean(pressure[:, seen], axis=1, keepdims=True))
                square = np.sum(centred[:, seen] ** 2, axis=1)
                scale = centred[:, seen] @ record.in_band(record.pressure)[seen] / np.maximum(square, 1e-300)
                pressure = scale[:, None] * pressure
            pressure = self._with_offset(pressure, record.pressure, seen)
        return Compared(velocity, acceleration, position, pressure)

    def _compares_pressure(self, record: Record) -> bool:
        return record.pressure is not None and self.model.pressures

    @staticmethod
    def _with_offset(simulated: np.ndarray, measured: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """Rows of simulated signals with the offset of least squares to the measured one where it is seen."""
        return np.asarray(simulated + np.mean((measured - simulated)[:, seen], axis=1, keepdims=True))

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals of all recordings, shape (m, n)."""
        with ThreadPoolExecutor(workers()) as pool:
            runs = list(pool.map(lambda record: self._compared(vectors, record), self.records))
        parts = []
        for record, run, (w_v, w_a, w_x, w_p) in zip(self.records, runs, self._weights(), strict=True):
            velocity, acceleration, position, pressure = run
            if record.position_measured:
                parts.append(record.whitened(w_v * (velocity - record.velocity)[:, record.start :], 0))
            if record.acceleration is not None:
                parts.append(record.whitened(-w_a * record.acceleration_left(acceleration), 1))
            if position is not None:
                parts.append(w_x * (position - record.position)[:, record.start :])
            if pressure is not None and record.pressure is not None:
                parts.append(record.whitened(w_p * (pressure - record.pressure)[:, record.start :], 2))
            own = slice(len(parts) - self._channels(record), len(parts))
            parts[own] = [self._in_band(part, record) for part in parts[own]]
            if record.acceleration is not None and record.explained is not None:
                parts[own.start + record.position_measured] += self._beyond(acceleration, record)
        parts += [(vectors[:, [i]] - value) / deviation for i, value, deviation in self.model.priors]
        return np.concatenate(parts, axis=1)

    def _in_band(self, part: np.ndarray, record: Record) -> np.ndarray:
        """Rows of residuals of one signal, or what they have below the band, as many samples of it as tell of it."""
        if self.band < HIGHEST / record.sample_time:
            part = low_pass(part, record.sample_time, self.band)
        return part[:, :: record.every]

    @staticmethod
    def _beyond(acceleration: np.ndarray, record: Record) -> np.ndarray:
        """What runs ring beyond the band that the command explains, over what the table does there.

        No run can have its phase, so the best one is calm; without that, what rings there would have no damping.
        """
        assert record.explained is not None
        ringing = (acceleration - record.in_band(acceleration))[:, record.start :]
        return np.asarray(CALM * ringing / record.explained.beyond)[:, :: record.every]

    @staticmethod
    def _samples(record: Record) -> np.ndarray:
        """Index of each sample of a recording that is compared."""
        return np.arange(record.start, len(record.commands), record.every)

    @property
    def count(self) -> int:
        """Number of residuals."""
        return sum(self.run_sizes())

    def _channels(self, record: Record) -> int:
        others = record.acceleration is not None, self.model.positions, self._compares_pressure(record)
        return record.position_measured + sum(others)

    def _weights(self) -> Iterator[tuple[float, float, float, float]]:
        """Of velocity, acceleration, position and pressure, record by record."""
        own = self.velocity_weights, self.acceleration_weights, self.position_weights, self.pressure_weights
        return zip(*own, strict=True)

    @property
    def noise_name(self) -> str:
        """What counts as noise, for a sentence."""
        band = self.records[0].explained
        return f"what a linear filter of the command leaves below {band.highest:.3g} Hz" if band else "the sensor noise"

    def noise_cost(self) -> float:
        """Mean square of the weighted residuals that the sensor noise alone would leave, or what no command tells [-].

        Noise that comes from the periods of a recording has what no command tells in it already.
        """
        total = 0.0
        for record, (w_v, w_a, w_x, w_p) in zip(self.records, self._weights(), strict=True):
            n = len(self._samples(record))
            share = 1.0 if record.noise_from_periods else self.unpredictable
            if record.position_measured:
                total += share * n * (w_v * record.velocity_noise()) ** 2
            if record.acceleration is not None:
                valid = np.count_nonzero(record.whole[self._samples(record)])
                total += share * valid * (w_a * record.acceleration_noise()) ** 2
            if self.model.positions:
                total += n * (w_x * record.position_noise()) ** 2
            if self._compares_pressure(record):
                total += share * n * (w_p * record.pressure_noise()) ** 2
        return float(total / self.count)

    def blocks(self, parameters: int = 0) -> np.ndarray:
        """Number of the block of time that each residual belongs to, shape (n,): the channels share it.

        parameters : that a fit has; where blocks would be fewer they are shorter, twice as many as these.
        """
        parts, first = [], 0
        seconds = sum((len(r.commands) - r.start) * r.sample_time for r in self.records)
        block = min(BLOCK, seconds / BLOCKS)
        if seconds / block < parameters:
            block = seconds / (2 * parameters)
        for record in self.records:
            n = len(self._samples(record))
            numbers = first + np.arange(n) // max(round(block / (record.sample_time * record.every)), 1)
            parts += [numbers] * self._channels(record)
            first = int(numbers[-1]) + 1
        return np.concatenate([*parts, first + np.arange(len(self.model.priors))])

    def run_sizes(self) -> list[int]:
        """Number of residuals of each recording."""
        return [len(self._samples(r)) * self._channels(r) for r in self.records]

    def independent(self) -> np.ndarray:
        """Part of an independent sample that each residual of the recordings is, shape (n,)."""
        parts = []
        for record in self.records:
            n = len(self._samples(record))
            if record.position_measured:
                parts += [np.full(n, independent_part(record.sample_time, record.every))]
            parts += [np.ones(n)] * (self._channels(record) - record.position_measured)
        return np.concatenate(parts)

    def samples_for_one(self, residuals: np.ndarray) -> float:
        """Residuals, shape (n,), for each independent one; mean over recordings and channels by their squares [-].

        What the filter of the velocity makes of white noise is in its weight and counts once.
        """
        squares = lasting = 0.0
        independent, first = self.independent(), 0
        for record in self.records:
            n, reach = len(self._samples(record)), round(BLOCK / (record.sample_time * record.every))
            for _ in range(self._channels(record)):
                part, alone, first = residuals[first : first + n], independent[first], first + n
                square = float(part @ part)
                squares += square
                lasting += square * max(alone * samples_for_one(part, reach), 1.0)
        return lasting / squares if squares > 0.0 else 1.0

    def times(self) -> np.ndarray:
        """Time since its recording's start of each residual, shape (n,) [s]."""
        parts = []
        for record in self.records:
            time = record.begin + self._samples(record) * record.sample_time
            parts += [time] * self._channels(record)
        return np.concatenate([*parts, np.zeros(len(self.model.priors))])

    def centred(self, vector: np.ndarray) -> np.ndarray:
        """A vector with the null shifts that leave least of the recordings for which it has none of their own.

        Gauss-Newton from none, recording by recording; a step that leaves more is halved.
        """
        width = len(self.model.layout.names)
        runs = sorted({r.run for r in self.records if r.run >= len(vector) - width})
        if not self.model.nuisances or not runs:
            return vector
        row = np.concatenate([vector, np.zeros(max(runs) + 1 - len(vector) + width)])
        columns = np.array([width + run for run in runs])
        of_run = self._runs()
        step = np.full(len(runs), NULL_STEP)
        change = np.zeros(len(runs))
        left = np.full(len(runs), np.inf)
        for _ in range(NULL_ROUNDS):
            tried = np.tile(row, (2, 1))
            tried[:, columns] += change
            tried[1, columns] += step
            found = np.nan_to_num(self.residuals(tried), nan=LOST)
            now = np.array([float(np.sum(found[0, of_run == run] ** 2)) for run in runs])
            for i, run in enumerate(runs):
                if now[i] < left[i]:
                    row[columns[i]] += change[i]
                    left[i], r = now[i], found[0, of_run == run]
                    d = (found[1, of_run == run] - r) / step[i]
                    change[i] = np.clip(-(d @ r) / max(d @ d, 1e-300), -NULL_MOST, NULL_MOST)
                else:
                    change[i] *= 0.5
        return row

    def left_by_run(self, vector: np.ndarray) -> dict[int, float]:
        """Sum of squares that a vector leaves of each recording, by its number."""
        left, of_run = np.nan_to_num(self.residuals(vector[None, :])[0], nan=LOST), self._runs()
        return {run: float(np.sum(left[of_run == run] ** 2)) for run in {r.run for r in self.records}}

    def _runs(self) -> np.ndarray:
        """Number of the recording that each residual belongs to, -1 of a prior, shape (n,)."""
        of_recordings = np.repeat([r.run for r in self.records], self.run_sizes())
        return np.concatenate([of_recordings, np.full(len(self.model.priors), -1)])

    def errors(self, vector: np.ndarray) -> dict[str, dict[str, float]]:
        """Relative error of velocity, acceleration and load pressure per recording, of what all its parts have."""
        vector = self.centred(vector)
        result: dict[str, dict[str, float]] = {}
        for name in dict.fromkeys(r.name for r in self.records):
            runs = [(r, self._compared(vector[None, :], r)) for r in self.records if r.name == name]
            pairs = [dict(self._pairs(r, run)) for r, run in runs]
            channels = [c for c in pairs[0] if all(c in of for of in pairs)]
            result[name] = {c: relative_error(*np.hstack([of[c] for of in pairs])) for c in channels}
        return result

    @staticmethod
    def _pairs(record: Record, run: Compared) -> Iterator[tuple[str, np.ndarray]]:
        """What was measured and what one run has of each channel, shape (2, n)."""
        span = slice(record.start, None)
        if record.position_measured:
            yield "velocity", np.array([record.velocity[span], run.velocity[0, span]])
        if record.acceleration is not None:
            yield "acceleration", np.array([record.acceleration, run.acceleration[0]])[:, span][:, record.whole[span]]
        if record.pressure is not None and run.pressure is not None:
            yield "load_pressure", np.array([record.pressure[span], run.pressure[0, span]])

    def noise(self) -> dict[str, float]:
        """Estimated noise of velocity [m/s] and acceleration [m/s²], root mean square of all recordings with it."""
        squares = {
            "velocity": [r.velocity_noise() ** 2 for r in self.records if r.position_measured],
            "acceleration": [r.acceleration_noise() ** 2 for r in self.records if r.acceleration is not None],
        }
        return {channel: float(np.sqrt(np.mean(known))) for channel, known in squares.items() if known}
