"""How late the accelerometer is against the position, from both signals alone.

An anti-aliasing filter delays what passes it, and a recording does not say so: the acceleration answers the second
derivative of the position by g e^(−jωδ)/(1 + jωτ). The delay δ of the filter tells nothing of the table and is taken
out of the recording; the lag τ of a slow sensor, which shows as a fall of the gain, stays for the model to explain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.analysis.frequency_response import SHORTEST, frequency_response
from shake_ros.core.identification.recordings import Record

WINDOW = 4.0  # of the response [s]
LOWEST, HIGHEST = 1.0, 40.0  # lines that are looked at [Hz]
COHERENT = 0.95  # below, the noise of the position biases the gain
FEWEST = 10  # lines
LAGS = np.concatenate(([0.0], np.geomspace(3e-4, 3e-2, 40)))  # [s]
WORTH = 0.8  # fall of the cost from which a lag counts as one


def between_sensors(
    records: Sequence[Record],
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64]]:
    """Angular frequency [rad/s], acceleration per second derivative of the position [-], weights; coherent lines."""
    lines, values, weights = [], [], []
    for record in records:
        seconds = len(record.position) * record.sample_time
        if record.acceleration is None or seconds < 4.0 * SHORTEST * record.sample_time:
            continue
        window = max(min(WINDOW, 0.4 * seconds), SHORTEST * record.sample_time)
        found = frequency_response(record.position, record.acceleration, record.sample_time, window)
        f = found.frequency
        use = (f >= LOWEST) & (f <= min(HIGHEST, 0.35 / record.sample_time)) & (found.coherence > COHERENT)
        lines.append(2.0 * np.pi * f[use])
        values.append(-found.response[use] / (2.0 * np.pi * f[use]) ** 2)
        weights.append(1.0 / (1.001 - found.coherence[use]))
    if not lines:
        return np.zeros(0), np.zeros(0, dtype=np.complex128), np.zeros(0)
    return np.concatenate(lines), np.concatenate(values), np.concatenate(weights)


def delay_and_lag(records: Sequence[Record]) -> tuple[float, float]:
    """Delay δ and lag τ of the accelerometer against the position [s]; both zero where they cannot be told."""
    omega, response, weight = between_sensors(records)
    if len(omega) < FEWEST or np.sum(weight * response.real) <= 0.0:
        return 0.0, 0.0
    weight = weight / np.sum(weight)
    costs, delays = [], []
    for lag in LAGS:
        left = response * (1.0 + 1j * omega * lag)
        size, angle = np.log(np.abs(left)), np.angle(left)
        delay = -float(np.sum(weight * omega * angle) / np.sum(weight * omega**2))
        spread = size - np.sum(weight * size)
        costs.append(float(np.sum(weight * (spread**2 + (angle + omega * delay) ** 2))))
        delays.append(delay)
    best = int(np.argmin(costs))
    best = best if costs[best] < WORTH * costs[0] and delays[best] > -1e-3 else 0
    return delays[best], float(LAGS[best])


def advanced(values: np.ndarray, samples: float) -> np.ndarray:
    """A signal a number of samples earlier, by the phase of its spectrum: noise keeps its size.

    >>> wave = np.sin(np.arange(200) / 7.0)
    >>> round(float(np.max(np.abs(advanced(wave, 0.5) - np.sin((np.arange(200) + 0.5) / 7.0))[5:-5])), 2)
    0.0
    """
    n = len(values)
    padded = np.concatenate([values, values[::-1]])  # without a step at the seam
    spectrum = np.fft.rfft(padded)
    turned = spectrum * np.exp(2j * np.pi * np.fft.rfftfreq(2 * n) * samples)
    return np.asarray(np.fft.irfft(turned, 2 * n)[:n])


def timely(record: Record, delay: float) -> Record:
    """The recording with its acceleration earlier by a delay [s]."""
    if record.acceleration is None or delay == 0.0:
        return record
    return replace(record, acceleration=advanced(record.acceleration, delay / record.sample_time))
