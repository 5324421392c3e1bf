"""Periodic excitations for identification: the multisine and the pseudo-random binary signal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import ShakeError, choice, quantity
from shake_ros.core.reference.motion import (
    Array,
    Motion,
    ReferenceParameters,
    crest_factor,
    peaks,
    sample_times,
    smooth_step,
)

ORDER = {"position": 0, "velocity": 1, "acceleration": 2}
GROUP = 4
"""Odd lines among which `odd_random` leaves one out."""


def relative_levels(text: str, frequency: Array) -> Array:
    """Relative level of each frequency [Hz] from 'f:level …'; ones for an empty text.

    >>> relative_levels("1:1 4:3", np.array([0.5, 1.0, 2.0, 4.0])).tolist()
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


@dataclass(frozen=True)
class MultisineParameters(ReferenceParameters):
    """A periodic sum of sines with seeded random phases, all lines or the odd ones only.

    With `odd` grids even lines stay empty, and with `odd_random` one odd line of every four is left out too, so
    that even and odd nonlinear distortions show up on lines of their own. Of `draws` sets of phases the one with the
    lowest crest factor is kept, and it is reported.
    Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach (2012), chapters 2 and 4.
    """

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

    def motion(self, sample_time: float) -> Motion:
        """The multisine, whole periods."""
        p = self
        count = round(p.period / sample_time)
        if abs(count * sample_time - p.period) > 1e-9 * p.period:
            raise ShakeError(f"multisine: period {p.period:g} s is not a whole number of samples of {sample_time:g} s")
        if p.end_frequency * sample_time >= 0.5:
            rate = 1.0 / sample_time
            raise ShakeError(f"multisine: end_frequency must stay below half the sampling rate {rate:g} Hz")
        time = sample_times(p.period * p.periods, sample_time)
        random = np.random.RandomState(p.seed)
        number = p.lines(random)
        order = ORDER[p.spectrum]
        amplitude = relative_levels(p.levels, number / p.period) / (2.0 * np.pi * number / p.period) ** order
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

    def lines(self, random: np.random.RandomState) -> Array:
        """Numbers of the excited lines, multiples of 1/period; raises ShakeError where the band holds none."""
        p = self
        first, last = math.ceil(p.start_frequency * p.period - 1e-9), math.floor(p.end_frequency * p.period + 1e-9)
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


def binary_period(bits: int) -> Array:
    """One period of ±1, (2ⁿ − 1,).

    >>> binary_period(3).tolist()
    [1.0, 1.0, 1.0, -1.0, 1.0, -1.0, -1.0]
    """
    from scipy.signal import max_len_seq  # slow to import, and only this reference needs it

    return np.asarray(2.0 * max_len_seq(bits)[0] - 1.0)


@dataclass(frozen=True)
class RandomBinaryParameters(ReferenceParameters):
    """Pseudo-random binary signal: between two positions, in an order that a shift register of maximal length gives.

    A register of n bits has a period of 2ⁿ − 1 chips whose autocorrelation is 1 at no lag and −1/(2ⁿ − 1) at every
    other: flat up to about 0.44 over the chip's length. Changes are C² ramps within a chip. Surveyed in 4.2 for
    identification; two levels do not show how a table bends with the amplitude, which is why the thesis prefers
    sines. Verified against: that autocorrelation; the derivatives of its ramps.
    """

    amplitude: float = quantity("m", "distance of both positions from the middle", low=-1.0, high=1.0, live=True)
    bits: int = quantity("-", "length n of the shift register", low=2, high=16)
    chip: float = quantity("s", "shortest time at a position, ramp included", low=1e-3, high=60.0)
    rise_time: float = quantity("s", "time of a ramp, at most a chip", low=0.0, high=60.0)
    periods: int = quantity("-", "number of periods of 2^n − 1 chips", low=1, high=1000)

    def motion(self, sample_time: float) -> Motion:
        """The signal, whole periods, from rest in the middle to rest there."""
        p = self
        if p.rise_time > p.chip:
            raise ShakeError(f"random_binary: rise_time {p.rise_time:g} s is longer than a chip of {p.chip:g} s")
        chips = np.tile(binary_period(p.bits), p.periods)
        stops = np.concatenate([[0.0], chips, [0.0]])  # level before the first chip, of each, and behind the last
        time = sample_times((len(chips) + 1) * p.chip, sample_time)
        chip = np.clip(np.floor(time / p.chip + 1e-9).astype(int), 0, len(chips))
        before, change = stops[chip], stops[chip + 1] - stops[chip]
        states = np.zeros((len(time), 3))
        if p.rise_time == 0.0:
            states[:, 0] = before + change
        else:
            value, slope, curvature = smooth_step((time - chip * p.chip) / p.rise_time)
            states[:, 0] = before + change * value
            states[:, 1] = change * slope / p.rise_time
            states[:, 2] = change * curvature / p.rise_time**2
        return Motion(p.amplitude * states, {"chips": len(chips)})
