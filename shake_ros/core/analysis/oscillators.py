"""Largest absolute acceleration of damped oscillators, also between samples and up to near half the sampling rate.

Each oscillator is advanced by the exact (ramp-invariant) recursion for an acceleration linear between samples, the
same solution as `response_spectrum`. A straight line between samples weakens content at f by sinc²(f h) and a peak
between two of them is missed; so the record, taken as band-limited, is first resampled through its Fourier transform
until a period of the oscillator has POINTS samples and multiplied by 1/sinc², and each local maximum is refined
by the parabola through its neighbours. Without that, the value at 0.4 of the sampling rate is a third too low.
Source of the recursion: N. C. Nigam and P. C. Jennings, Bulletin of the Seismological Society of America 59 (1969),
909–922. Verified against: scipy's matrix exponential, the spectrum of a record sampled 64 times as finely,
and the closed form of the response to a sine.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.plant.simulation import workers
from shake_ros.core.quantities import ShakeError

Array = NDArray[np.float64]
POINTS = 16.0  # samples of a period, at least; more above NARROW, where the record itself shines through
NARROW = 0.05  # damping
HIGHEST = 0.45  # of the sampling rate: above, the record holds nothing that a spectrum could show
WIDE, CHUNK = 8, 512  # oscillators side by side, and samples between two looks at their maxima
CLOSE = 0.95  # share of the largest value so far from which a local maximum is refined


@njit
def _filter(h, omega, xi):  # type: ignore[no-untyped-def]
    """Ramp-invariant filter of −(2ξω ẋ + ω² x): b_0, b_1, b_2 of a and c_1, c_2 of what came before."""
    root = math.sqrt(1.0 - xi * xi)
    decay = math.exp(-xi * omega * h)
    s, c = math.sin(omega * root * h), math.cos(omega * root * h)
    k, e2, si = 1.0 / (omega * h), decay * decay, s * decay / root
    b0 = 1.0 - si * k
    b1 = 2.0 * (si * k - decay * c)
    return b0, b1, e2 - si * k, 2.0 * decay * c, -e2


@njit
def _peaks(a, h, omega, xi, values, times):  # type: ignore[no-untyped-def]
    """Signed largest absolute accelerations of oscillators from rest, and their times; WIDE oscillators at once."""
    y = np.zeros((CHUNK + 2, WIDE))
    b0, b1, b2, c1, c2 = np.zeros(WIDE), np.zeros(WIDE), np.zeros(WIDE), np.zeros(WIDE), np.zeros(WIDE)
    best, place = np.zeros(WIDE), np.zeros(WIDE)
    for first in range(0, omega.size, WIDE):
        count = min(WIDE, omega.size - first)
        y[:] = 0.0
        best[:] = 0.0
        for j in range(count):
            b0[j], b1[j], b2[j], c1[j], c2[j] = _filter(h, omega[first + j], xi)
        for start in range(2, a.size, CHUNK):
            size = min(CHUNK, a.size - start)
            for i in range(size):
                a0, a1, a2 = a[start + i], a[start + i - 1], a[start + i - 2]
                for j in range(WIDE):
                    y[i + 2, j] = b0[j] * a0 + b1[j] * a1 + b2[j] * a2 + c1[j] * y[i + 1, j] + c2[j] * y[i, j]
            for j in range(count):
                limit = CLOSE * abs(best[j])
                for i in range(1, size + 1):
                    now = y[i, j]
                    if abs(now) > limit and (now - y[i - 1, j]) * (y[i + 1, j] - now) <= 0.0:
                        bend = y[i - 1, j] - 2.0 * now + y[i + 1, j]
                        slope = y[i - 1, j] - y[i + 1, j]
                        shift = 0.5 * slope / bend if bend != 0.0 else 0.0
                        value = now - 0.25 * slope * shift
                        if abs(value) > abs(best[j]):
                            best[j], place[j] = value, (start + i - 2 + shift) * h
                            limit = CLOSE * abs(value)
            for j in range(WIDE):
                y[0, j], y[1, j] = y[size, j], y[size + 1, j]
        for j in range(count):
            if abs(y[1, j]) > abs(best[j]):  # still growing where the record ends
                best[j], place[j] = y[1, j], (a.size - 1) * h
            values[first + j], times[first + j] = best[j], place[j]


def resampled(acceleration: Array, factor: int, straight: bool = True) -> Array:
    """A band-limited record at `factor` times its rate; `straight` raises it by what lines between samples take away.

    The record is at rest at both ends; shape ((n − 1) factor + 1,).
    """
    n = acceleration.size
    size = 1 << (n + n // 8).bit_length()
    spectrum = np.fft.rfft(acceleration, size)
    if straight:
        share = np.arange(spectrum.size) / (size * factor)  # of the new sampling rate
        spectrum = spectrum / np.sinc(share) ** 2
    fine = np.fft.irfft(spectrum, size * factor) * factor
    return np.ascontiguousarray(fine[: (n - 1) * factor + 1])


def peaks(acceleration: Array, time_step: float, frequencies: Array, damping: float) -> tuple[Array, Array]:
    """Signed largest absolute accelerations of oscillators, and when they come.

    Parameters
    ----------
    acceleration : (n,) [m/s²], band-limited, at rest at both ends. time_step : [s].
    frequencies : (m,) natural frequencies [Hz]. damping : ξ, 0 … 1, both excluded [-].

    Returns
    -------
    values (m,) [m/s²], times (m,) [s]

    Raises
    ------
    ShakeError : damping or frequencies out of range, a record that is too short or not finite.
    """
    a = np.ascontiguousarray(acceleration, dtype=np.float64)
    f = np.ascontiguousarray(frequencies, dtype=np.float64)
    if not 0.0 < damping < 1.0:
        raise ShakeError(f"response spectrum: damping = {damping:g} is not between 0 and 1")
    if a.size < 8 or not np.isfinite(a).all():
        bad = int(a.size - np.count_nonzero(np.isfinite(a)))
        raise ShakeError(f"response spectrum: a record of {a.size} samples with {bad} that are not finite numbers")
    if f.size == 0 or not (f.min() > 0.0 and f.max() * time_step <= HIGHEST * (1.0 + 1e-9)):
        raise ShakeError(
            f"response spectrum: frequencies must lie above 0 and up to {HIGHEST:g} of the sampling rate, "
            f"{HIGHEST / time_step:.4g} Hz at {1.0 / time_step:.4g} Hz; asked for {f.max(initial=0.0):.4g} Hz"
        )
    factors = 2 ** np.ceil(np.log2(np.maximum(POINTS * max(1.0, damping / NARROW) * f * time_step, 1.0))).astype(int)
    values, times = np.empty(f.size), np.empty(f.size)

    def work(part: tuple[int, Array, NDArray[np.intp]]) -> None:
        factor, record, index = part
        found, when = np.empty(index.size), np.empty(index.size)
        _peaks(record, time_step / factor, 2.0 * np.pi * f[index], damping, found, when)
        values[index], times[index] = found, when

    parts = []
    for factor in np.unique(factors):
        record = resampled(a, int(factor))
        parts += [(int(factor), record, index) for index in np.array_split(np.flatnonzero(factors == factor), 8)]
    with ThreadPoolExecutor(workers()) as pool:
        list(pool.map(work, [part for part in parts if part[2].size]))
    return values, times


def acceleration_spectrum(acceleration: Array, time_step: float, frequencies: Array, damping: float) -> Array:
    """Absolute acceleration spectrum, (m,) [m/s²]; arguments and errors as of `peaks`.

    At resonance a long sine is amplified to √(1 + 4ξ²)/(2ξ):

    >>> sine = np.sin(2 * np.pi * 5 * np.arange(20000) / 1000)
    >>> round(float(acceleration_spectrum(sine, 0.001, np.array([5.0]), 0.05)[0]), 3)
    10.05
    """
    return np.abs(peaks(acceleration, time_step, frequencies, damping)[0])
