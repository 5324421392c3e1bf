"""Motions with a closed form: rest, sine, sine beats, sweep, step, pulse, multisine, pseudo-random binary signal.

Velocity and acceleration are exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shake_ros.control.reference.motion import (
    Array,
    Motion,
    ReferenceParameters,
    crest_factor,
    peaks,
    product,
    sample_times,
    smooth_step,
)
from shake_ros.quantities import ShakeError, choice, quantity

SHARPNESS = 8  # exponent of the corners of a sweep's amplitude


@dataclass(frozen=True)
class NoneParameters(ReferenceParameters):
    """The table is asked to stay in its middle."""

    duration: float = quantity("s", "length", low=0.01, high=3600.0)

    def motion(self, sample_time: float) -> Motion:
        """Zero throughout."""
        return Motion(np.zeros((sample_times(self.duration, sample_time).size, 3)), {})


@dataclass(frozen=True)
class SineParameters(ReferenceParameters):
    """x = A sin(2π f t); soft start and stop come from the shaping."""

    amplitude: float = quantity("m", "amplitude of the position", low=0.0, high=1.0, live=True)
    frequency: float = quantity("Hz", "frequency", low=0.001, high=200.0, live=True)
    duration: float = quantity("s", "length, soft start and stop included", low=0.01, high=3600.0)

    def motion(self, sample_time: float) -> Motion:
        """The sine from rest at phase zero."""
        omega = 2.0 * np.pi * self.frequency
        phase = omega * sample_times(self.duration, sample_time)
        position = self.amplitude * np.sin(phase)
        velocity = self.amplitude * omega * np.cos(phase)
        return Motion(np.column_stack((position, velocity, -(omega**2) * position)), {})


@dataclass(frozen=True)
class SineBeatParameters(ReferenceParameters):
    """At each test frequency, sines that swell and fade within a beat, with pauses between the beats.

        a(t) = A sin(π f t/N) sin(2π f t),  0 ≤ t ≤ N/f

    with N cycles a beat, as two sines of f (1 ∓ 1/2N), so that velocity and position follow in closed form. A beat ends
    without velocity, but A (1/ω_1² − 1/ω_2²) aside of where it began; the table returns on a smooth ramp within the
    pause. Beats and pauses as in general use for the single-frequency tests of IEC 60068-2-59 (5 or 10 cycles, pauses
    of at least 2 s so that one beat's motion has died out), which was not read in the original here.
    Verified against: its own derivatives, and the peak A.
    """

    frequencies: str = choice("test frequencies in turn, separated by blanks [Hz]")
    amplitude: float = quantity("m/s²", "A, largest acceleration of a beat", low=1e-6, high=1000.0, live=True)
    cycles: int = quantity("-", "N, cycles of the test frequency in a beat", low=2, high=1000)
    beats: int = quantity("-", "beats at each frequency", low=1, high=1000)
    pause: float = quantity("s", "rest after each beat", low=0.1, high=600.0)

    def motion(self, sample_time: float) -> Motion:
        """All beats at all frequencies."""
        p = self
        frequencies = np.repeat(p.test_frequencies(sample_time), p.beats)
        ends = np.cumsum(p.cycles / frequencies + p.pause)
        time = sample_times(float(ends[-1]), sample_time)
        states = np.zeros((len(time), 3))
        for frequency, end in zip(frequencies.tolist(), ends.tolist(), strict=True):
            begin = end - p.cycles / frequency - p.pause
            part = slice(int(np.searchsorted(time, begin)), int(np.searchsorted(time, end)) + 1)
            states[part] = beat(time[part] - begin, frequency, p.amplitude, p.cycles, p.pause)
        return Motion(states, {})

    def test_frequencies(self, sample_time: float) -> Array:
        """The frequencies [Hz].

        Raises
        ------
        ShakeError : no positive numbers, or above half the sampling rate.
        """
        try:
            found = np.array([float(word) for word in self.frequencies.split()])
        except ValueError:
            raise ShakeError(f"sine_beat: frequencies = '{self.frequencies}' are not numbers") from None
        if not found.size or not (np.isfinite(found) & (found > 0.0)).all():
            raise ShakeError(f"sine_beat: frequencies = '{self.frequencies}': positive numbers are needed")
        if (1.0 + 0.5 / self.cycles) * found.max() * sample_time >= 0.5:
            raise ShakeError(f"sine_beat: frequencies must stay below half the sampling rate {1.0 / sample_time:g} Hz")
        return found


def beat(time: Array, frequency: float, amplitude: float, cycles: int, pause: float) -> Array:
    """A beat from time 0 with its pause, rest before and after: (n, 3) position, velocity, acceleration."""
    length = cycles / frequency
    low, high = (2.0 * np.pi * frequency * (1.0 + side / cycles) for side in (-0.5, 0.5))
    t = np.clip(time, 0.0, length)
    position = amplitude / 2.0 * ((1.0 - np.cos(low * t)) / low**2 - (1.0 - np.cos(high * t)) / high**2)
    velocity = amplitude / 2.0 * (np.sin(low * t) / low - np.sin(high * t) / high)
    acceleration = amplitude / 2.0 * (np.cos(low * t) - np.cos(high * t))
    aside = amplitude * (1.0 / low**2 - 1.0 / high**2)
    back = smooth_step((time - length) / pause)
    way = np.column_stack([back[0], back[1] / pause, back[2] / pause**2])
    inside = (time >= 0.0) & (time <= length)
    shaken = np.column_stack([position, np.where(inside, velocity, 0.0), np.where(inside, acceleration, 0.0)])
    return np.asarray(shaken - aside * way)


@dataclass(frozen=True)
class SweepParameters(ReferenceParameters):
    """A sine whose frequency moves from one value to another, linearly or by equal octaves per second.

    The amplitude follows 1/A^8 = 1/x_max^8 + (ω/v_max)^8 + (ω²/a_max)^8: position, then velocity, then
    acceleration sets it, with smooth corners and below all three (but for the small part that the sweep's rate adds).
    """

    spacing: str = choice("how the frequency moves: linear in time, or log (octaves)", ("linear", "log"))
    start_frequency: float = quantity("Hz", "frequency at the start", low=0.001, high=200.0)
    end_frequency: float = quantity("Hz", "frequency at the end", low=0.001, high=200.0)
    duration: float = quantity("s", "length, soft start and stop included", low=0.1, high=3600.0)
    peak_position: float = quantity("m", "largest position", low=1e-6, high=1.0, live=True)
    peak_velocity: float = quantity("m/s", "largest velocity", low=1e-6, high=10.0, live=True)
    peak_acceleration: float = quantity("m/s²", "largest acceleration", low=1e-6, high=1000.0, live=True)

    def motion(self, sample_time: float) -> Motion:
        """The sweep from phase zero."""
        if max(self.start_frequency, self.end_frequency) * sample_time >= 0.5:
            raise ShakeError(f"sweep: frequencies must stay below half the sampling rate {1.0 / sample_time:g} Hz")
        angle, omega, rate, curve = self.phase(sample_times(self.duration, sample_time))
        sine = (np.sin(angle), omega * np.cos(angle), rate * np.cos(angle) - omega**2 * np.sin(angle))
        return Motion(product(self.amplitude(omega, rate, curve), sine), {})

    def phase(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Phase [rad], its rate ω [rad/s], and the first and second derivative of ω by time; each (n,)."""
        first, last = 2.0 * np.pi * self.start_frequency, 2.0 * np.pi * self.end_frequency
        if self.spacing == "linear" or first == last:
            rate = (last - first) / self.duration
            return (
                first * time + 0.5 * rate * time**2,
                first + rate * time,
                np.full_like(time, rate),
                np.zeros_like(time),
            )
        octaves = np.log(last / first) / self.duration
        omega = first * np.exp(octaves * time)
        return (omega - first) / octaves, omega, octaves * omega, octaves**2 * omega

    def amplitude(self, omega: Array, rate: Array, curve: Array) -> tuple[Array, Array, Array]:
        """Amplitude [m] at ω and its first two derivatives by time; each (n,)."""
        p = SHARPNESS
        x, v, a = self.peak_position, self.peak_velocity, self.peak_acceleration
        by_velocity, by_acceleration = (x * omega / v) ** p, (x * omega**2 / a) ** p
        total = 1.0 + by_velocity + by_acceleration
        slope = p * (by_velocity + 2.0 * by_acceleration) / omega  # derivative of `total` by ω
        bend = p * ((p - 1) * by_velocity + 2.0 * (2 * p - 1) * by_acceleration) / omega**2
        d_total, dd_total = slope * rate, bend * rate**2 + slope * curve
        value = x * total ** (-1.0 / p)
        d_value = -value / p * d_total / total
        dd_value = -value / p * (dd_total / total - (1.0 + 1.0 / p) * (d_total / total) ** 2)
        return value, d_value, dd_value


def ramp(time: Array, start: float, rise_time: float) -> Array:
    """Rows (value, slope, curvature) of a unit ramp from 0 to 1 that begins at `start` [s]; shape (n, 3)."""
    if rise_time == 0.0:
        return np.column_stack((np.where(time >= start, 1.0, 0.0), np.zeros_like(time), np.zeros_like(time)))
    value, slope, curvature = smooth_step((time - start) / rise_time)
    return np.column_stack((value, slope / rise_time, curvature / rise_time**2))


@dataclass(frozen=True)
class StepParameters(ReferenceParameters):
    """From 0 to an amplitude along a C² ramp, then held.

    A rise time of 0 gives the bare step, which only makes sense in front of the reference filter (5.1).
    """

    amplitude: float = quantity("m", "position after the step", low=-1.0, high=1.0, live=True)
    delay: float = quantity("s", "rest before the step", low=0.0, high=3600.0)
    rise_time: float = quantity("s", "time of the ramp; 0 = bare step for the filter", low=0.0, high=60.0)
    duration: float = quantity("s", "length, delay included", low=0.01, high=3600.0)

    def motion(self, sample_time: float) -> Motion:
        """The step."""
        time = sample_times(self.duration, sample_time)
        return Motion(self.amplitude * ramp(time, self.delay, self.rise_time), {})


@dataclass(frozen=True)
class PulseParameters(ReferenceParameters):
    """Up along a C² ramp, held, down again; repeated with equal or alternating sign."""

    amplitude: float = quantity("m", "height of a pulse", low=-1.0, high=1.0, live=True)
    delay: float = quantity("s", "rest before the first pulse", low=0.0, high=3600.0)
    rise_time: float = quantity("s", "time of each flank; 0 = bare flanks for the filter", low=0.0, high=60.0)
    hold_time: float = quantity("s", "time at full height", low=0.0, high=3600.0)
    rest_time: float = quantity("s", "rest after each pulse", low=0.0, high=3600.0)
    repetitions: int = quantity("-", "number of pulses", low=1, high=10000)
    alternating: bool = quantity("-", "whether every second pulse goes the other way")

    def motion(self, sample_time: float) -> Motion:
        """The train of pulses."""
        p = self
        period = 2.0 * p.rise_time + p.hold_time + p.rest_time
        time = sample_times(p.delay + p.repetitions * period, sample_time)
        index = np.clip(np.floor((time - p.delay) / period) if period > 0.0 else 0.0 * time, 0, p.repetitions - 1)
        local = time - p.delay - index * period
        states = ramp(local, 0.0, p.rise_time) - ramp(local, p.rise_time + p.hold_time, p.rise_time)
        sign = np.where(index % 2 == 1, -1.0, 1.0) if p.alternating else np.ones_like(time)
        return Motion(p.amplitude * sign[:, None] * states, {})


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
