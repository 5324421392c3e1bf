"""Sine: x = A sin(2π f t).

Closed form, so velocity and acceleration are exact. Soft start and stop come from the shaping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, quantity
from shake_ros.core.reference.motion import EarthquakeRecord, Motion, sample_times


@dataclass(frozen=True)
class SineParameters(Parameters):
    amplitude: float = quantity("m", "amplitude of the position", low=0.0, high=1.0, live=True)
    frequency: float = quantity("Hz", "frequency", low=0.001, high=200.0, live=True)
    duration: float = quantity("s", "length, soft start and stop included", low=0.01, high=3600.0)


def motion(parameters: SineParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """The sine from rest at phase zero; `record` is not used."""
    omega = 2.0 * np.pi * parameters.frequency
    phase = omega * sample_times(parameters.duration, sample_time)
    position = parameters.amplitude * np.sin(phase)
    velocity = parameters.amplitude * omega * np.cos(phase)
    return Motion(np.column_stack((position, velocity, -(omega**2) * position)), {})
