"""The newest samples of every curve on one grid, measured and by the model, and frames of them for the pages.

A frame holds minimum and maximum of every bucket. A bucket of level L holds 2^L samples; a page asks for the level
whose buckets are no wider than a pixel of its curves, so that a spike of one sample is seen whatever the window. All
pages of one level get the same bytes.

`Prediction` is what the declared model makes of the measured command: velocity and acceleration, sample by sample.

The free run of `identify` and `close_loop`: from the command alone, volumes and friction at the measured position. It
goes on under the last command where a few samples are missing, and begins at rest behind a longer gap.

`RunMeter` finds the runs, from the first motion of the reference to its rest: how well each was tracked, its spectrum.
"""

from __future__ import annotations

import math
import struct
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.states import POSITION, VELOCITY
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import ShakeError
from shake_ros.signals.response_spectrum import response_spectrum

Row = npt.NDArray[np.float32]
FASTEST = 20.0  # a model that runs away is begun again [m/s]
SETTLING = 0.3  # after a beginning at rest, while the table may move, the model says nothing [s]
LONGEST_GAP = 50  # samples that may be missing


class Prediction:
    """One model that follows the table.

    Parameters
    ----------
    sample_time : [s].
    model : table to predict with.
    """

    def __init__(self, sample_time: float, model: TableParameters | None) -> None:
        self._sample_time = sample_time
        self._state: np.ndarray | None = None
        self._command, self._missing, self._settled = 0.0, 0, 0.0
        self.use(model)

    def use(self, model: TableParameters | None) -> None:
        """Predict with another model from now on; safe from another thread."""
        table = Table(model, self._sample_time) if model is not None else None
        if table is not None:  # compiled before the first sample
            table.true_acceleration(table.advance(table.initial_state(), 0.0))
        self._table, self._state = table, None

    def advance(self, commands: Row, positions: Row, supply: Row) -> tuple[Row, Row]:
        """Velocity [m/s] and acceleration [m/s²] of the next samples.

        Parameters
        ----------
        commands, positions, supply : shape (n,) [-], [m], [Pa]; NaN where missing.
        """
        velocity, acceleration = np.full((2, len(commands)), np.nan, dtype=np.float32)
        table, state = self._table, self._state
        if table is None:
            return velocity, acceleration
        for k, (u, x, pressure) in enumerate(zip(commands.tolist(), positions.tolist(), supply.tolist(), strict=True)):
            here = math.isfinite(u) and math.isfinite(x)
            self._missing = 0 if here else self._missing + 1
            if self._missing > LONGEST_GAP or (state is None and not here):
                state = None
                continue
            if state is None:
                state, self._settled = table.initial_state(x), 0.0
            if here:
                state[POSITION], self._command = x, u
            if math.isfinite(pressure):
                table.set_supply_pressure(pressure)
            if self._settled > SETTLING:
                velocity[k], acceleration[k] = state[VELOCITY], table.true_acceleration(state)
            self._settled += self._sample_time
            try:
                state = table.advance(state, self._command)
            except ShakeError:
                state = None
            if state is not None and abs(state[VELOCITY]) > FASTEST:
                state = None
        if table is self._table:
            self._state = state
        return velocity, acceleration


Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

SECONDS = 130.0  # kept
LEVELS = 8  # the last one has buckets of 128 samples: 120 s at 1 kHz on 938 pixels
LATE = 0.5  # a topic that comes later than this behind the newest is not waited for [s]
RESTART = 5.0  # a step of the stamps larger than this is another run [s]
KEPT = 6  # frames that several pages may get; one of the whole window has megabytes
HEADER = struct.Struct("<4I2d")  # level, epoch, buckets, curves; first bucket, seconds of a bucket


@dataclass(frozen=True)
class LiveCurve:
    """One curve. topic : where it comes from; empty where the page computes it. column : of the topic's numbers."""

    name: str
    topic: str
    column: int


CURVES = (
    LiveCurve("reference_position", "reference", 0),
    LiveCurve("position", "joint_states", 0),
    LiveCurve("tracking_error", "", 0),
    LiveCurve("reference_velocity", "reference", 1),
    LiveCurve("estimated_velocity", "estimate", 1),
    LiveCurve("predicted_velocity", "", 0),
    LiveCurve("reference_acceleration", "reference", 2),
    LiveCurve("acceleration", "imu", 0),
    LiveCurve("estimated_acceleration", "estimate", 2),
    LiveCurve("predicted_acceleration", "", 0),
    LiveCurve("valve_command", "valve_command", 0),
    LiveCurve("pressure_a", "pressure_a", 0),
    LiveCurve("pressure_b", "pressure_b", 0),
    LiveCurve("pressure_supply", "pressure_supply", 0),
    LiveCurve("twin_acceleration", "predicted_imu", 0),
)
LATER = ("predicted_imu",)  # topics that are not waited for: they come when all else of their samples is settled
ROW = {curve.name: row for row, curve in enumerate(CURVES)}
TOPICS = tuple(dict.fromkeys(curve.topic for curve in CURVES if curve.topic))


class SampleStore:
    """Rings of samples, filled by the node and read by the server's thread.

    Parameters
    ----------
    period : of the samples [ns].
    prediction : of velocity and acceleration by the model.

    Attributes
    ----------
    epoch : number of the run; a restart of the stamps begins another.
    settled : first sample that may still change, but for the topics `LATER`.
    later : first sample to which these have not come.
    """

    def __init__(self, period: int, prediction: Prediction) -> None:
        self.period, self.prediction = period, prediction
        self._size = 1 << int(np.ceil(np.log2(SECONDS * 1e9 / period)))
        self._rings = np.full((len(CURVES), 2 * self._size), np.nan, dtype=np.float32)
        self._guard = threading.Lock()
        self._frame = lru_cache(maxsize=KEPT)(self._build)
        self.epoch = 0
        self._begin(-1)

    def _begin(self, origin: int) -> None:
        self._origin = origin
        self._phase: dict[str, float] = {}
        self._newest = -1
        self._came: dict[str, int] = {}  # topic → its newest sample
        self.settled = self.later = 0
        self.epoch += 1
        self._rings[:] = np.nan
        self._frame.cache_clear()

    @property
    def sample_time(self) -> float:
        """[s]"""
        return self.period * 1e-9

    def add(self, topic: str, stamps: Integers, values: Floats) -> None:
        """Samples of a topic: (n,) stamps [ns] and (n, width) numbers; what is not stamped is left out."""
        good = stamps > 0
        stamps, values = stamps[good], values[good]
        if not len(stamps):
            return
        with self._guard:
            newest, later = self._origin + self._newest * self.period, topic in LATER
            if not later and (self._origin < 0 or abs(stamps[-1] - newest) > RESTART * 1e9):
                self._begin(int(stamps[0]))
            indices = self._indices(topic, stamps)
            fresh = (indices > self._newest - self._size // 2) & (indices >= 0)
            fresh &= (indices <= self._newest) | (not later)
            indices, values = indices[fresh], values[fresh]
            if not len(indices):
                return
            last = int(indices.max())
            self._advance(last)
            if later:
                self.later = max(self.later, last + 1)
                self._frame.cache_clear()
            else:
                self._came[topic] = max(self._came.get(topic, -1), last)
            places = indices % self._size
            for row, curve in enumerate(CURVES):
                if curve.topic == topic and curve.column < values.shape[1]:
                    self._rings[row, places] = self._rings[row, places + self._size] = values[:, curve.column]

    def _indices(self, topic: str, stamps: Integers) -> Integers:
        """Samples on the grid; a topic whose stamps lie between two of it keeps its own offset."""
        exact = (stamps - self._origin) / self.period
        phase = self._phase.get(topic)
        if phase is None or abs(exact[0] - phase - round(exact[0] - phase)) > 0.4:
            phase = self._phase[topic] = exact[0] - round(exact[0])
        found: Integers = np.rint(exact - phase).astype(np.int64)
        return found

    def _advance(self, newest: int) -> None:
        """Make room up to sample `newest`."""
        if newest <= self._newest:
            return
        room = np.arange(max(self._newest + 1, newest - self._size + 1), newest + 1) % self._size
        self._rings[:, room] = self._rings[:, room + self._size] = np.nan
        self._newest = newest

    def settle(self) -> None:
        """Compute the curves of one's own for all samples that every topic has come to, but for one that is late."""
        with self._guard:
            late = self._newest - round(LATE / self.sample_time)
            last = min((newest for newest in self._came.values() if newest >= late), default=-1) + 1
            first = max(self.settled, last - self._size // 2)
            if last <= first:
                return
            rows = self._slice(first, last)
            error = rows[ROW["reference_position"]] - rows[ROW["position"]]
            predicted = self.prediction.advance(
                rows[ROW["valve_command"]], rows[ROW["position"]], rows[ROW["pressure_supply"]]
            )
            places = np.arange(first, last) % self._size
            computed = {"tracking_error": error, "predicted_velocity": predicted[0]}
            computed["predicted_acceleration"] = predicted[1]
            for name, values in computed.items():
                self._rings[ROW[name], places] = self._rings[ROW[name], places + self._size] = values
            self.settled = last

    def _slice(self, first: int, last: int) -> npt.NDArray[np.float32]:
        """Samples first … last − 1 of all curves, shape (curves, last − first); no more than fit."""
        place = first % self._size
        return self._rings[:, place : place + last - first]

    def newest(self, name: str, seconds: float) -> Floats:
        """The latest settled samples of a curve, shape (n,), in the unit of its topic."""
        with self._guard:
            first = max(0, self.settled - round(seconds / self.sample_time), self.settled - self._size + 1)
            return self._slice(first, self.settled)[ROW[name]].astype(np.float64)

    def time(self) -> float:
        """Time of the newest settled sample from the start of the epoch [s]."""
        return self.settled * self.sample_time

    def frame(self, level: int, first: int, window: float) -> tuple[bytes, int]:
        """Buckets from `first` on, at most those of the latest `window` [s]; and the bucket that comes next."""
        with self._guard:
            last = self.settled >> level
            oldest = max(0, self._newest - self._size + 1 + (1 << level)) >> level
            first = max(first, last - round(window / self.sample_time / (1 << level)), oldest)
            return (self._frame(level, first, last), last) if last > first else (b"", max(first, 0))

    def between(self, level: int, start: float, stop: float) -> bytes:
        """Buckets of an interval of time [s], as far as they are kept."""
        with self._guard:
            step = self.sample_time * (1 << level)
            last = min(int(stop / step) + 1, self.settled >> level)
            oldest = (max(0, self._newest - self._size + 1) >> level) + 1
            first = max(int(start / step), oldest if self._newest >= self._size else 0)
            return self._build(level, first, max(first, last))

    def _build(self, level: int, first: int, last: int) -> bytes:
        rows = self._slice(first << level, last << level)
        head = HEADER.pack(level, self.epoch, last - first, len(CURVES), float(first), self.sample_time * (1 << level))
        if level == 0:
            return head + rows.tobytes()
        buckets: Any = rows.reshape(len(CURVES), -1, 1 << level)
        low, high = np.fmin.reduce(buckets, axis=2), np.fmax.reduce(buckets, axis=2)
        return head + low.tobytes() + high.tobytes()


REST = 1e-5  # a slower reference is at rest [m/s]
PAUSE = 0.6  # a run ends when it has been at rest for so long [s]
SHORTEST = 0.5  # [s]
LONGEST = 120.0  # of a run, the rest is not looked at [s]
KEPT_RUNS = 12
PERIODS = 60
BANDS = 220  # points of a spectrum


class RunMeter:
    """Looks at what is settled; `runs` holds the latest runs, the newest last."""

    def __init__(self, store: SampleStore) -> None:
        self._store = store
        self._seen = (store.epoch, 0)
        self._moving = 0.0  # how long the present run lasts, rests included [s]
        self._rest = 0.0
        self.runs: list[dict[str, Any]] = []

    def look(self, words: Mapping[str, str]) -> None:
        """After each `settle`; `words` say what runs: reference, controller, observer, table."""
        store = self._store
        epoch, seen = self._seen
        if epoch != store.epoch:
            self._moving = self._rest = 0.0
            seen = 0
        fresh = (store.settled - seen) * store.sample_time
        self._seen = store.epoch, store.settled
        if fresh <= 0.0:
            return
        moves = np.abs(store.newest("reference_velocity", fresh)) > REST
        if moves.any():
            self._moving += fresh
            self._rest = 0.0
        elif self._moving:
            self._moving += fresh
            self._rest += fresh
            if self._rest >= PAUSE:
                if self._moving - self._rest > SHORTEST:
                    self._take(min(self._moving, LONGEST), words)
                self._moving = self._rest = 0.0

    def _take(self, seconds: float, words: Mapping[str, str]) -> None:
        store = self._store
        names = ("tracking_error", "reference_position", "acceleration", "reference_acceleration")
        error, wanted, felt, asked = (store.newest(name, seconds) for name in names)
        if np.isfinite(error).any():
            row = dict(words, ended=time.time(), seconds=seconds - self._rest)
            threading.Thread(target=self._judge, args=(row, error, wanted, felt, asked), daemon=True).start()

    def _judge(self, row: dict[str, Any], error: Floats, wanted: Floats, felt: Floats, asked: Floats) -> None:
        """Not in the thread that takes samples: a spectrum takes a while, and compiles at first."""
        from shake_ros.control.metrics import DAMPING, HIGHEST, LOWEST

        known = np.isfinite(error)
        rms = float(np.sqrt(np.mean(error[known] ** 2)))
        size = float(np.sqrt(np.nanmean((wanted - np.nanmean(wanted)) ** 2)))
        periods = np.geomspace(1.0 / HIGHEST, 1.0 / LOWEST, PERIODS)
        step = self._store.sample_time
        spectra = [
            np.abs(response_spectrum(np.nan_to_num(a), step, 1.0 / periods, DAMPING).acceleration)
            for a in (felt, asked)
        ]
        run = {
            **row, "error_rms": rms, "error_peak": float(np.abs(error[known]).max()),
            "error_relative": rms / size if size > 0.0 else None,
            "periods": _short(periods), "spectrum": _short(spectra[0]), "wanted": _short(spectra[1]),
        }  # fmt: skip
        self.runs = [*self.runs[-KEPT_RUNS + 1 :], run]


def _short(values: Floats) -> list[float]:
    return [float(f"{value:.4g}") for value in values]


@lru_cache(maxsize=4)
def _flat_top(n: int) -> Floats:
    turn = 2.0 * np.pi * np.arange(n) / n
    weights = (0.21557895, -0.41663158, 0.277263158, -0.083578947, 0.006947368)
    return np.sum([a * np.cos(k * turn) for k, a in enumerate(weights)], axis=0)


def amplitude_spectrum(values: Floats, sample_time: float) -> tuple[Floats, Floats]:
    """Frequencies [Hz] and amplitudes of a segment, the largest of each band on a logarithmic axis; missing is zero.

    A flat-top window, so that the amplitude of a line is its own wherever it falls between two bins.
    """
    n = len(values)
    if n < 256:
        return np.zeros(0), np.zeros(0)
    window = _flat_top(n)
    amplitude = np.abs(np.fft.rfft(np.nan_to_num(values) * window)) * 2.0 / np.sum(window)
    frequency = np.asarray(np.fft.rfftfreq(n, sample_time), dtype=np.float64)
    edges = np.unique(np.searchsorted(frequency, np.geomspace(4.0 / (n * sample_time), frequency[-1], BANDS)))
    edges = edges[edges < len(frequency)]
    highest: Floats = np.maximum.reduceat(amplitude, edges)
    return frequency[edges], highest
