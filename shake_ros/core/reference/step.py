"""Step: from 0 to an amplitude along a C² ramp, then held.

A rise time of 0 gives the bare step, which only makes sense in front of the reference filter (5.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, quantity
from shake_ros.core.reference.motion import Array, EarthquakeRecord, Motion, sample_times, smooth_step


@dataclass(frozen=True)
class StepParameters(Parameters):
    amplitude: float = quantity("m", "position after the step", low=-1.0, high=1.0, live=True)
    delay: float = quantity("s", "rest before the step", low=0.0, high=3600.0)
    rise_time: float = quantity("s", "time of the ramp; 0 = bare step for the filter", low=0.0, high=60.0)
    duration: float = quantity("s", "length, delay included", low=0.01, high=3600.0)


def ramp(time: Array, start: float, rise_time: float) -> Array:
    """Rows (value, slope, curvature) of a unit ramp from 0 to 1 that begins at `start` [s]; shape (n, 3)."""
    if rise_time == 0.0:
        return np.column_stack((np.where(time >= start, 1.0, 0.0), np.zeros_like(time), np.zeros_like(time)))
    value, slope, curvature = smooth_step((time - start) / rise_time)
    return np.column_stack((value, slope / rise_time, curvature / rise_time**2))


def motion(parameters: StepParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """The step; `record` is not used."""
    time = sample_times(parameters.duration, sample_time)
    return Motion(parameters.amplitude * ramp(time, parameters.delay, parameters.rise_time), {})
