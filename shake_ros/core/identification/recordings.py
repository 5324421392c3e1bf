"""Recordings as a fit sees them, and the free-running simulation error over several of them (chapter 4, 6.3.3.2).

Open-loop positions drift, so velocity and acceleration are fitted. Velocity is the zero-phase filtered derivative of
the measured position; the simulated velocity goes through the same filter (filtered against filtered). Volumes and
position-dependent effects follow the measured position.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import butter, sosfiltfilt

from shake_ros.core.plant.simulation import initial_state, run_batch

CUTOFF = 40.0  # bandwidth of the velocity filter [Hz], (6.3.3.2)
ORDER = 4  # per pass; forward and backward make the thesis's 8
SETTLE = 0.5  # start of a recording that is simulated but not compared [s]: pressures are not known there
NOISE_BAND = 0.4  # accelerations above this part of the sampling rate are taken for noise
MODEL_FLOOR = 2e-3  # weights do not fall below this part of a channel's rms: no model is better than that


def low_pass(values: np.ndarray, sample_time: float) -> np.ndarray:
    """Zero-phase Butterworth low-pass along the last axis; below 100 Hz sampling the values pass unchanged."""
    if CUTOFF >= 0.4 / sample_time:
        return np.asarray(values)
    sections = butter(ORDER, CUTOFF * 2.0 * sample_time, output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=-1))


def derivative(position: np.ndarray, sample_time: float) -> np.ndarray:
    """Low-passed central difference of a position, shape (n,) [m] → [m/s]."""
    return low_pass(np.gradient(position, sample_time), sample_time)


def high_band_deviation(values: np.ndarray, sample_time: float) -> float:
    """Standard deviation of white noise whose upper band is all that is left of `values` above the dynamics."""
    sections = butter(6, 2.0 * NOISE_BAND, btype="high", output="sos")
    upper = sosfiltfilt(sections, values)
    middle = upper[len(upper) // 20 : -len(upper) // 20 or None]
    robust = 1.4826 * np.median(np.abs(middle))  # impulses of stick and slip do not count as noise
    return float(robust / np.sqrt(1.0 - 2.0 * NOISE_BAND))


@dataclass(frozen=True)
class Record:
    """One recording, all arrays of shape (n,), SI units; acceleration may be absent."""

    name: str
    sample_time: float
    commands: np.ndarray
    position: np.ndarray
    acceleration: np.ndarray | None = None
    velocity: np.ndarray = field(init=False)
    track: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "velocity", derivative(self.position, self.sample_time))
        object.__setattr__(self, "track", low_pass(self.position, self.sample_time))

    @property
    def start(self) -> int:
        """First sample that is compared."""
        return min(round(SETTLE / self.sample_time), len(self.commands) // 4)

    def position_noise(self) -> float:
        """Standard deviation of the position noise [m]."""
        return high_band_deviation(self.position, self.sample_time)

    def velocity_noise(self) -> float:
        """Standard deviation of the noise that passes the velocity filter [m/s]."""
        rng = np.random.default_rng(0)
        white = rng.standard_normal(20000)
        gain = float(np.std(derivative(white, self.sample_time)[1000:-1000]))
        return gain * self.position_noise()

    def acceleration_noise(self) -> float:
        """Standard deviation of the acceleration noise [m/s²]."""
        assert self.acceleration is not None
        return high_band_deviation(self.acceleration, self.sample_time)


def relative_error(measured: np.ndarray, simulated: np.ndarray) -> float:
    """rms(measured − simulated) / rms(measured − mean)."""
    return float(np.sqrt(np.mean((measured - simulated) ** 2)) / np.std(measured))


class RecordingProblem:
    """Weighted free-running simulation error over several recordings.

    Each channel is weighted by its noise, with a floor relative to its size; velocity counts with the number of its
    independent samples in the filter's band.
    """

    def __init__(self, records: list[Record]) -> None:
        self.records = records
        self.velocity_weights = []
        self.acceleration_weights = []
        for r in records:
            floor = MODEL_FLOOR * float(np.std(r.velocity[r.start :]))
            independent = min(2.0 * CUTOFF * r.sample_time, 1.0)
            self.velocity_weights.append(np.sqrt(independent) / np.hypot(r.velocity_noise(), floor))
            if r.acceleration is not None:
                floor = MODEL_FLOOR * float(np.std(r.acceleration[r.start :]))
                self.acceleration_weights.append(1.0 / np.hypot(r.acceleration_noise(), floor))
            else:
                self.acceleration_weights.append(0.0)

    def simulate(self, vectors: np.ndarray, record: Record) -> tuple[np.ndarray, np.ndarray]:
        """Filtered velocity and acceleration of one recording, each of shape (m, n)."""
        starts = np.array([initial_state(v, record.track[0]) for v in vectors])
        starts[:, 1] = record.velocity[0]
        out = run_batch(vectors, starts, record.commands, record.sample_time, track=record.track)
        return low_pass(out[:, :, 0], record.sample_time), out[:, :, 1]

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals of all recordings, shape (m, n)."""
        parts = []
        for record, w_v, w_a in zip(self.records, self.velocity_weights, self.acceleration_weights, strict=True):
            velocity, acceleration = self.simulate(vectors, record)
            parts.append(w_v * (velocity - record.velocity)[:, record.start :])
            if record.acceleration is not None:
                parts.append(w_a * (acceleration - record.acceleration)[:, record.start :])
        return np.concatenate(parts, axis=1)

    def errors(self, vector: np.ndarray) -> dict[str, dict[str, float]]:
        """Relative error of velocity and acceleration per recording."""
        result = {}
        for record in self.records:
            velocity, acceleration = self.simulate(vector[None, :], record)
            span = slice(record.start, None)
            entry = {"velocity": relative_error(record.velocity[span], velocity[0, span])}
            if record.acceleration is not None:
                entry["acceleration"] = relative_error(record.acceleration[span], acceleration[0, span])
            result[record.name] = entry
        return result
