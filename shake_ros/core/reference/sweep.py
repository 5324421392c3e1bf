"""Sweep: a sine whose frequency moves from one value to another, linearly or by equal octaves per second.

The amplitude follows 1/A^8 = 1/x_max^8 + (ω/v_max)^8 + (ω²/a_max)^8: position, then velocity, then
acceleration sets it, with smooth corners and below all three (but for the small part that the sweep's rate adds).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.core.reference.motion import Array, EarthquakeRecord, Motion, product, sample_times

SHARPNESS = 8


@dataclass(frozen=True)
class SweepParameters(Parameters):
    spacing: str = choice("how the frequency moves: linear in time, or log (octaves)", ("linear", "log"))
    start_frequency: float = quantity("Hz", "frequency at the start", low=0.001, high=200.0)
    end_frequency: float = quantity("Hz", "frequency at the end", low=0.001, high=200.0)
    duration: float = quantity("s", "length, soft start and stop included", low=0.1, high=3600.0)
    peak_position: float = quantity("m", "largest position", low=1e-6, high=1.0, live=True)
    peak_velocity: float = quantity("m/s", "largest velocity", low=1e-6, high=10.0, live=True)
    peak_acceleration: float = quantity("m/s²", "largest acceleration", low=1e-6, high=1000.0, live=True)


def phase(parameters: SweepParameters, time: Array) -> tuple[Array, Array, Array, Array]:
    """Phase [rad], its rate ω [rad/s], and the first and second derivative of ω by time; each (n,)."""
    first, last = 2.0 * np.pi * parameters.start_frequency, 2.0 * np.pi * parameters.end_frequency
    if parameters.spacing == "linear" or first == last:
        rate = (last - first) / parameters.duration
        return first * time + 0.5 * rate * time**2, first + rate * time, np.full_like(time, rate), np.zeros_like(time)
    octaves = np.log(last / first) / parameters.duration
    omega = first * np.exp(octaves * time)
    return (omega - first) / octaves, omega, octaves * omega, octaves**2 * omega


def amplitude(parameters: SweepParameters, omega: Array, rate: Array, curve: Array) -> tuple[Array, Array, Array]:
    """Amplitude [m] at ω and its first two derivatives by time; each (n,)."""
    p = SHARPNESS
    x, v, a = parameters.peak_position, parameters.peak_velocity, parameters.peak_acceleration
    by_velocity, by_acceleration = (x * omega / v) ** p, (x * omega**2 / a) ** p
    total = 1.0 + by_velocity + by_acceleration
    slope = p * (by_velocity + 2.0 * by_acceleration) / omega  # derivative of `total` by ω
    bend = p * ((p - 1) * by_velocity + 2.0 * (2 * p - 1) * by_acceleration) / omega**2
    d_total, dd_total = slope * rate, bend * rate**2 + slope * curve
    value = x * total ** (-1.0 / p)
    d_value = -value / p * d_total / total
    dd_value = -value / p * (dd_total / total - (1.0 + 1.0 / p) * (d_total / total) ** 2)
    return value, d_value, dd_value


def motion(parameters: SweepParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """The sweep from phase zero; `record` is not used."""
    if max(parameters.start_frequency, parameters.end_frequency) * sample_time >= 0.5:
        raise ShakeError(f"sweep: frequencies must stay below half the sampling rate {1.0 / sample_time:g} Hz")
    angle, omega, rate, curve = phase(parameters, sample_times(parameters.duration, sample_time))
    sine = (np.sin(angle), omega * np.cos(angle), rate * np.cos(angle) - omega**2 * np.sin(angle))
    return Motion(product(amplitude(parameters, omega, rate, curve), sine), {})
