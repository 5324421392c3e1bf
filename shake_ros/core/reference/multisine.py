"""Multisine: a periodic sum of sines with seeded random phases, all lines or the odd ones only.

With `odd` grids even lines stay empty, and with `odd_random` one odd line of every four is left out too, so
that even and odd nonlinear distortions show up on lines of their own. Of `draws` sets of phases the one with the
lowest crest factor is kept, and it is reported.
Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach (2012), chapters 2 and 4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.core.reference.motion import Array, EarthquakeRecord, Motion, crest_factor, peaks, sample_times

ORDER = {"position": 0, "velocity": 1, "acceleration": 2}
GROUP = 4
"""Odd lines among which `odd_random` leaves one out."""


@dataclass(frozen=True)
class MultisineParameters(Parameters):
    period: float = quantity("s", "length of one period; 1/period spaces the lines", low=0.01, high=1000.0)
    periods: int = quantity("-", "number of periods", low=1, high=100000)
    start_frequency: float = quantity("Hz", "lowest line", low=0.001, high=200.0)
    end_frequency: float = quantity("Hz", "highest line", low=0.001, high=200.0)
    grid: str = choice("which lines are excited", ("full", "odd", "odd_random"))
    spectrum: str = choice("what the levels are amplitudes of", tuple(ORDER))
    levels: str = choice("relative levels 'f:level f:level …' [Hz:-], interpolated over log f; empty = flat")
    seed: int = quantity("-", "seed of phases and of left-out lines", low=0, high=2**31 - 1)
    draws: int = quantity("-", "sets of phases tried for a low crest factor", low=1, high=10000)
    peak_position: float = quantity("m", "largest position", low=1e-6, high=1.0, live=True)
    peak_velocity: float = quantity("m/s", "largest velocity", low=1e-6, high=10.0, live=True)
    peak_acceleration: float = quantity("m/s²", "largest acceleration", low=1e-6, high=1000.0, live=True)


def lines(parameters: MultisineParameters, random: np.random.RandomState) -> Array:
    """Numbers of the excited lines, multiples of 1/period; raises ShakeError where the band holds none."""
    p = parameters
    first, last = int(np.ceil(p.start_frequency * p.period - 1e-9)), int(np.floor(p.end_frequency * p.period + 1e-9))
    numbers = np.arange(max(first, 1), last + 1)
    if p.grid != "full":
        numbers = numbers[numbers % 2 == 1]
    if p.grid == "odd_random":
        groups = numbers.size // GROUP
        numbers = np.delete(numbers, np.arange(groups) * GROUP + random.randint(0, GROUP, groups))
    if numbers.size == 0:
        band = f"{p.start_frequency:g} and {p.end_frequency:g} Hz"
        raise ShakeError(f"multisine: no {p.grid} line between {band} at a spacing of {1 / p.period:g} Hz")
    return numbers.astype(np.float64)


def levels(text: str, frequency: Array) -> Array:
    """Relative level of each frequency [Hz] from 'f:level …'; ones for an empty text.

    >>> levels("1:1 4:3", np.array([0.5, 1.0, 2.0, 4.0])).tolist()
    [1.0, 1.0, 2.0, 3.0]
    """
    if not text.strip():
        return np.ones_like(frequency)
    try:
        pairs = [tuple(float(part) for part in word.split(":")) for word in text.split()]
        given = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    except ValueError:
        raise ShakeError(f"multisine: levels '{text}' are not of the form 'frequency:level frequency:level'") from None
    rising = bool(np.all(np.diff(given[:, 0]) > 0.0))
    if not (np.all(np.isfinite(given)) and rising and np.all(given[:, 0] > 0.0) and np.all(given[:, 1] >= 0.0)):
        raise ShakeError(f"multisine: levels '{text}' need rising frequencies above 0 and levels of at least 0")
    return np.interp(np.log(frequency), np.log(given[:, 0]), given[:, 1])


def _one_period(amplitude: Array, number: Array, angle: Array, count: int, period: float) -> Array:
    """Rows (position, velocity, acceleration) of one period of `count` samples; shape (count, 3)."""
    omega = 2.0 * np.pi * number / period
    states = np.empty((count, 3))
    for order in range(3):
        spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
        spectrum[number.astype(np.int64)] = 0.5 * count * amplitude * np.exp(1j * angle) * (1j * omega) ** order
        states[:, order] = np.fft.irfft(spectrum, count)
    return states


def motion(parameters: MultisineParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """The multisine, whole periods; `record` is not used."""
    p = parameters
    count = round(p.period / sample_time)
    if abs(count * sample_time - p.period) > 1e-9 * p.period:
        raise ShakeError(f"multisine: period {p.period:g} s is not a whole number of samples of {sample_time:g} s")
    if p.end_frequency * sample_time >= 0.5:
        raise ShakeError(f"multisine: end_frequency must stay below half the sampling rate {1.0 / sample_time:g} Hz")
    time = sample_times(p.period * p.periods, sample_time)
    random = np.random.RandomState(p.seed)
    number = lines(p, random)
    order = ORDER[p.spectrum]
    amplitude = levels(p.levels, number / p.period) / (2.0 * np.pi * number / p.period) ** order
    if not np.any(amplitude > 0.0):
        raise ShakeError("multisine: every level is zero")
    best = np.empty((0, 3))
    for _ in range(p.draws):
        angle = random.uniform(0.0, 2.0 * np.pi, number.size)
        trial = _one_period(amplitude, number, angle, count, p.period)
        if best.size == 0 or crest_factor(trial[:, order]) < crest_factor(best[:, order]):
            best = trial
    limits = (p.peak_position, p.peak_velocity, p.peak_acceleration)
    best = best * min(limit / peak for limit, peak in zip(limits, peaks(best), strict=True))
    notes = {"lines": int(number.size), "crest_factor": crest_factor(best[:, order]), "period_samples": count}
    return Motion(best[np.arange(time.size) % count], notes)
