"""Sine beats: at each test frequency, sines that swell and fade within a beat, with pauses between the beats.

    a(t) = A sin(π f t/N) sin(2π f t),  0 ≤ t ≤ N/f

with N cycles a beat, as two sines of f (1 ∓ 1/2N), so that velocity and position follow in closed form. A beat ends
without velocity, but A (1/ω_1² − 1/ω_2²) aside of where it began; the table returns on a smooth ramp within the pause.
Beats and pauses as in general use for the single-frequency tests of IEC 60068-2-59 (5 or 10 cycles, pauses of at least
2 s so that one beat's motion has died out), which was not read in the original here.
Verified against: its own derivatives, and the peak A.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.core.reference.motion import Array, EarthquakeRecord, Motion, sample_times, smooth_step


@dataclass(frozen=True)
class SineBeatParameters(Parameters):
    frequencies: str = choice("test frequencies in turn, separated by blanks [Hz]")
    amplitude: float = quantity("m/s²", "A, largest acceleration of a beat", low=1e-6, high=1000.0, live=True)
    cycles: int = quantity("-", "N, cycles of the test frequency in a beat", low=2, high=1000)
    beats: int = quantity("-", "beats at each frequency", low=1, high=1000)
    pause: float = quantity("s", "rest after each beat", low=0.1, high=600.0)


def frequencies_of(parameters: SineBeatParameters, sample_time: float) -> Array:
    """The frequencies [Hz].

    Raises
    ------
    ShakeError : no positive numbers, or above half the sampling rate.
    """
    try:
        found = np.array([float(word) for word in parameters.frequencies.split()])
    except ValueError:
        raise ShakeError(f"sine_beat: frequencies = '{parameters.frequencies}' are not numbers") from None
    if not found.size or not (np.isfinite(found) & (found > 0.0)).all():
        raise ShakeError(f"sine_beat: frequencies = '{parameters.frequencies}': positive numbers are needed")
    if (1.0 + 0.5 / parameters.cycles) * found.max() * sample_time >= 0.5:
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


def motion(parameters: SineBeatParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """All beats at all frequencies; `record` is not used."""
    p = parameters
    frequencies = np.repeat(frequencies_of(p, sample_time), p.beats)
    ends = np.cumsum(p.cycles / frequencies + p.pause)
    time = sample_times(float(ends[-1]), sample_time)
    states = np.zeros((len(time), 3))
    for frequency, end in zip(frequencies.tolist(), ends.tolist(), strict=True):
        begin = end - p.cycles / frequency - p.pause
        part = slice(int(np.searchsorted(time, begin)), int(np.searchsorted(time, end)) + 1)
        states[part] = beat(time[part] - begin, frequency, p.amplitude, p.cycles, p.pause)
    return Motion(states, {})
