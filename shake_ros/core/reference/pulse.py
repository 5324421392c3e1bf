"""Pulse: up along a C² ramp, held, down again; repeated with equal or alternating sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, quantity
from shake_ros.core.reference.motion import EarthquakeRecord, Motion, sample_times
from shake_ros.core.reference.step import ramp


@dataclass(frozen=True)
class PulseParameters(Parameters):
    amplitude: float = quantity("m", "height of a pulse", low=-1.0, high=1.0, live=True)
    delay: float = quantity("s", "rest before the first pulse", low=0.0, high=3600.0)
    rise_time: float = quantity("s", "time of each flank; 0 = bare flanks for the filter", low=0.0, high=60.0)
    hold_time: float = quantity("s", "time at full height", low=0.0, high=3600.0)
    rest_time: float = quantity("s", "rest after each pulse", low=0.0, high=3600.0)
    repetitions: int = quantity("-", "number of pulses", low=1, high=10000)
    alternating: bool = quantity("-", "whether every second pulse goes the other way")


def motion(parameters: PulseParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """The train of pulses; `record` is not used."""
    p = parameters
    period = 2.0 * p.rise_time + p.hold_time + p.rest_time
    time = sample_times(p.delay + p.repetitions * period, sample_time)
    index = np.clip(np.floor((time - p.delay) / period) if period > 0.0 else 0.0 * time, 0, p.repetitions - 1)
    local = time - p.delay - index * period
    states = ramp(local, 0.0, p.rise_time) - ramp(local, p.rise_time + p.hold_time, p.rise_time)
    sign = np.where(index % 2 == 1, -1.0, 1.0) if p.alternating else np.ones_like(time)
    return Motion(p.amplitude * sign[:, None] * states, {})
