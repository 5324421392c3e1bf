"""Motions with a closed form: rest, sine, sine beats, sweep, step, pulse; velocity and acceleration are exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import ShakeError, choice, quantity
from shake_ros.core.reference.motion import Array, Motion, ReferenceParameters, product, sample_times, smooth_step

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
