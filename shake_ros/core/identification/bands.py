"""The error of a free run by band of frequency, velocity and acceleration apart.

What friction leaves stands in other bands than what the oil column leaves, and a ringing that no command determines
shows in one band alone. Residual and signal are split by their spectra, which leaves their mean squares whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.identification.recordings import RecordingProblem

EDGES = (0.0, 1.0, 3.0, 10.0, 30.0, np.inf)  # [Hz]


@dataclass(frozen=True)
class BandError:
    """Error of one channel of a recording in one band.

    Attributes
    ----------
    low, high : edges of the band [Hz]. error : rms of the residual in the band over the rms of the measured signal in
    all bands [-]. share : of the measured signal's mean square that is in the band [-].
    """

    recording: str
    channel: str
    low: float
    high: float
    error: float
    share: float


def mean_squares(values: np.ndarray, sample_time: float) -> np.ndarray:
    """Mean square of a signal in each band, shape (len(EDGES) − 1,); they sum to its variance.

    >>> wave = 2.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(2000) / 1000.0)
    >>> mean_squares(wave, 1e-3).round(6).tolist()
    [0.0, 0.0, 2.0, 0.0, 0.0]
    """
    n = len(values)
    power = np.abs(np.fft.rfft(values - values.mean())) ** 2 / n**2
    power[1 : len(power) - 1 + n % 2] *= 2.0
    band = np.searchsorted(EDGES, np.fft.rfftfreq(n, sample_time), side="right") - 1
    return np.asarray(np.bincount(band, power, minlength=len(EDGES) - 1))


def band_errors(problem: RecordingProblem, vector: np.ndarray) -> tuple[BandError, ...]:
    """Errors of a table's free run by recording, channel and band."""
    found = []
    for name in dict.fromkeys(r.name for r in problem.records):
        sums: dict[str, list[np.ndarray]] = {}
        for record in (r for r in problem.records if r.name == name):
            velocity, acceleration = problem.simulate(vector[None, :], record)
            pairs = {"velocity": (record.velocity, velocity[0])}
            if record.acceleration is not None:
                pairs["acceleration"] = (record.acceleration, acceleration[0])
            for channel, (measured, simulated) in pairs.items():
                seen, left = measured[record.start :], (measured - simulated)[record.start :]
                both = np.array([mean_squares(s, record.sample_time) for s in (left, seen)]) * len(seen)
                sums.setdefault(channel, []).append(both)
        for channel, parts in sums.items():
            left, seen = np.sum(parts, axis=0)
            total = max(float(seen.sum()), 1e-300)
            for i, (low, high) in enumerate(zip(EDGES[:-1], EDGES[1:], strict=True)):
                error = float(np.sqrt(left[i] / total))
                found.append(BandError(name, channel, low, high, error, float(seen[i] / total)))
    return tuple(found)
