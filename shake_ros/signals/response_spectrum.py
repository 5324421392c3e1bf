"""Response spectra: the largest relative displacement and absolute acceleration of damped oscillators.

Each oscillator ẍ + 2ξω ẋ + ω² x = −a(t) starts at rest and is advanced exactly for an acceleration that is linear
between samples. Between two steps the extremum is that of the cubic through values and slopes at both. Behind the last
sample the acceleration falls to zero within one more, and the first extremum of the free vibration counts too: later
ones are smaller.

A record may also be taken as band-limited, as a sensor's samples are. Straight lines weaken content at f by sinc²(f h),
a third at 0.4 of the sampling rate; so such a record is first resampled through its Fourier transform and multiplied
by 1/sinc².

Source: N. C. Nigam and P. C. Jennings, Bulletin of the Seismological Society of America 59 (1969), 909–922.
Verified against: a matrix exponential with a record sampled up to 64 times as finely (benchmarks/qualification/
spectra.py), scipy's integration, closed forms of the response to a step and to a sine.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.physics.plant.simulation import workers
from shake_ros.quantities import ShakeError

Array = NDArray[np.float64]
POINTS = 16.0  # steps in a period, at least: the cubic between two of them then misses at most 0.01 %
NARROW = 0.05  # damping above which a band-limited record is resampled more finely, for it shines through
HIGHEST = 0.45  # of the sampling rate: above, a band-limited record holds nothing that a spectrum could show
WIDE, CHUNK = 8, 512  # oscillators side by side, and steps between two looks at their extrema
CLOSE = 0.9  # share of the largest value so far below which a step holds no larger extremum


class Peaks(NamedTuple):
    """Of each oscillator: |relative displacement| [m], signed absolute acceleration [m/s²], time of the latter [s]."""

    displacement: Array
    acceleration: Array
    time: Array


@njit
def _transition(theta, xi):  # type: ignore[no-untyped-def]
    """Over a step of θ = ωh, of (ω² x, ω ẋ): rows of the transition, and what a at both ends adds to each."""
    root = math.sqrt(1.0 - xi * xi)
    decay = math.exp(-xi * theta)
    c, s = decay * math.cos(root * theta), decay * math.sin(root * theta) / root
    a, b, d = c + xi * s, s, c - xi * s
    still, turning = 1.0 - a, -s  # −a from rest to a constant acceleration
    ramp_x, ramp_v = (2.0 * xi * still + s - theta) / theta, (2.0 * xi * s + d - 1.0) / theta
    return a, b, -b, d, -still - ramp_x, ramp_x, turning - ramp_v, ramp_v


@njit
def _extremum(y0, y1, m0, m1):  # type: ignore[no-untyped-def]
    """Value and place 0 … 1 of the extremum of a cubic between two points, whose slopes differ in sign."""
    d = y1 - y0
    a, b = 3.0 * (m0 + m1 - 2.0 * d), 2.0 * (3.0 * d - 2.0 * m0 - m1)
    q = -0.5 * (b + math.copysign(math.sqrt(max(b * b - 4.0 * a * m0, 0.0)), b))
    t = m0 / q if q != 0.0 else 0.0
    if not 0.0 <= t <= 1.0 and a != 0.0:
        t = q / a
    t = min(max(t, 0.0), 1.0)
    return y0 + t * (m0 + t * (0.5 * b + t * a / 3.0)), t


@njit
def _free(y, slope, xi):  # type: ignore[no-untyped-def]
    """First extremum of a free vibration from a value and its slope over ωt, and the ωt at which it comes."""
    root = math.sqrt(1.0 - xi * xi)
    turned = (slope + xi * y) / root
    phase = math.atan2(slope, xi * turned + root * y) % math.pi
    return math.exp(-xi * phase / root) * (y * math.cos(phase) + turned * math.sin(phase)), phase / root


@njit
def _largest(a, h, parts, omega, xi, largest, values, times):  # type: ignore[no-untyped-def]
    """Largest ω²|x|, signed largest ẍ + a and its time; `parts` steps a sample, WIDE oscillators at once."""
    x, v, y = np.zeros((CHUNK + 1, WIDE)), np.zeros((CHUNK + 1, WIDE)), np.zeros((CHUNK + 1, WIDE))
    load, step, total = np.zeros(CHUNK + 1), h / parts, a.size * parts
    k = np.zeros((8, WIDE))
    reach, swing = np.zeros(WIDE), np.zeros(WIDE)
    for first in range(0, omega.size, WIDE):
        count = min(WIDE, omega.size - first)
        k[:], x[0], v[0], y[0] = 0.0, 0.0, 0.0, 0.0
        for j in range(count):
            row = _transition(omega[first + j] * step, xi)
            for i in range(8):
                k[i, j] = row[i]
            largest[first + j] = values[first + j] = times[first + j] = 0.0
        for start in range(0, total, CHUNK):
            size = min(CHUNK, total - start)
            for i in range(size + 1):
                place, part = divmod(start + i, parts)
                now = a[place] if place < a.size else 0.0
                then = a[place + 1] if place + 1 < a.size else 0.0
                load[i] = now + (then - now) * part / parts
            reach[:], swing[:] = np.abs(x[0]), np.abs(y[0])
            for i in range(size):
                p, q = load[i], load[i + 1]
                for j in range(WIDE):
                    x_j = k[0, j] * x[i, j] + k[1, j] * v[i, j] + k[4, j] * p + k[5, j] * q
                    v_j = k[2, j] * x[i, j] + k[3, j] * v[i, j] + k[6, j] * p + k[7, j] * q
                    y_j = -x_j - 2.0 * xi * v_j
                    x[i + 1, j], v[i + 1, j], y[i + 1, j] = x_j, v_j, y_j
                    reach[j], swing[j] = max(reach[j], abs(x_j)), max(swing[j], abs(y_j))
            for j in range(count):
                n, theta = first + j, omega[first + j] * step
                if reach[j] > CLOSE * largest[n]:
                    for i in range(size):
                        if v[i, j] * v[i + 1, j] <= 0.0 and max(abs(x[i, j]), abs(x[i + 1, j])) > CLOSE * largest[n]:
                            value, _ = _extremum(x[i, j], x[i + 1, j], theta * v[i, j], theta * v[i + 1, j])
                            largest[n] = max(largest[n], abs(value))
                if swing[j] > CLOSE * abs(values[n]):
                    for i in range(size):
                        if max(abs(y[i, j]), abs(y[i + 1, j])) > CLOSE * abs(values[n]):
                            m0 = theta * (2.0 * xi * (load[i] - y[i, j]) - v[i, j])
                            m1 = theta * (2.0 * xi * (load[i + 1] - y[i + 1, j]) - v[i + 1, j])
                            if m0 * m1 <= 0.0:
                                value, at = _extremum(y[i, j], y[i + 1, j], m0, m1)
                                if abs(value) > abs(values[n]):
                                    values[n], times[n] = value, (start + i + at) * step
            x[0], v[0], y[0] = x[size], v[size], y[size]
        for j in range(count):
            n = first + j
            largest[n] = max(largest[n], abs(_free(x[0, j], v[0, j], xi)[0]))
            value, later = _free(y[0, j], -2.0 * xi * y[0, j] - v[0, j], xi)
            if abs(value) > abs(values[n]):
                values[n], times[n] = value, total * step + later / omega[n]


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


def response_spectrum(
    acceleration: Array, time_step: float, frequencies: Array, damping: float, band_limited: bool = False
) -> Peaks:
    """The largest motions of oscillators, from rest, during a record and in the free vibration behind it.

    Parameters
    ----------
    acceleration : (n,) [m/s²], linear between samples; or band-limited and at rest at both ends.
    time_step : [s].
    frequencies : (m,) natural frequencies [Hz].
    damping : ξ, from 0 to below 1 [-].
    band_limited : how the record is taken between its samples.

    Returns
    -------
    Peaks of shape (m,) each.

    Raises
    ------
    ShakeError : damping or frequencies out of range, a record that is too short or not finite.

    A long sine at the resonance is amplified to √(1 + 4ξ²)/(2ξ):

    >>> sine = np.sin(2 * np.pi * 5 * np.arange(20000) / 1000)
    >>> round(float(np.abs(response_spectrum(sine, 0.001, np.array([5.0]), 0.05).acceleration[0])), 2)
    10.05
    """
    a = np.ascontiguousarray(acceleration, dtype=np.float64)
    f = np.ascontiguousarray(frequencies, dtype=np.float64)
    _check(a, time_step, f, damping, band_limited)
    points = POINTS * (max(1.0, damping / NARROW) if band_limited else 1.0) * f * time_step
    finer = 2 ** np.ceil(np.log2(np.maximum(points, 1.0))).astype(int)
    largest, values, times = np.empty(f.size), np.empty(f.size), np.empty(f.size)

    def work(part: tuple[Array, int, int, NDArray[np.intp]]) -> None:
        record, factor, parts, index = part
        found = np.empty((3, index.size))
        _largest(record, time_step / factor, parts, 2.0 * np.pi * f[index], damping, found[0], found[1], found[2])
        largest[index], values[index], times[index] = found

    tasks = []
    for times_finer in np.unique(finer).tolist():
        factor, parts = (times_finer, 1) if band_limited else (1, times_finer)
        record = resampled(a, factor) if band_limited else a
        pieces = np.array_split(np.flatnonzero(finer == times_finer), 8)
        tasks += [(record, factor, parts, index) for index in pieces if index.size]
    with ThreadPoolExecutor(workers()) as pool:
        list(pool.map(work, tasks))
    return Peaks(largest / (2.0 * np.pi * f) ** 2, values, times)


def _check(a: Array, time_step: float, f: Array, damping: float, band_limited: bool) -> None:
    """Raise ShakeError for what is no record or no oscillator."""
    if not 0.0 <= damping < 1.0:
        raise ShakeError(f"response spectrum: damping = {damping:g} is outside 0 … 1")
    if a.ndim != 1 or a.size < 2 or not time_step > 0.0 or not np.isfinite(a).all():
        bad = int(a.size - np.count_nonzero(np.isfinite(a)))
        raise ShakeError(
            f"response spectrum: {a.size} samples at {time_step:g} s, {bad} of them not finite, are not an accelerogram"
        )
    if f.size == 0 or not (f.min() > 0.0 and np.isfinite(f).all()):
        raise ShakeError("response spectrum: frequencies must be above 0 Hz, periods above 0 s")
    if band_limited and f.max() * time_step > HIGHEST * (1.0 + 1e-9):
        raise ShakeError(
            f"response spectrum: a band-limited accelerogram at {1.0 / time_step:.4g} Hz has one up to {HIGHEST:g} of "
            "that, "
            f"{HIGHEST / time_step:.4g} Hz; asked for {f.max():.4g} Hz"
        )
