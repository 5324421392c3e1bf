"""None: the table is asked to stay in its middle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, quantity
from shake_ros.core.reference.motion import EarthquakeRecord, Motion, sample_times


@dataclass(frozen=True)
class NoneParameters(Parameters):
    duration: float = quantity("s", "length", low=0.01, high=3600.0)


def motion(parameters: NoneParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """Zero throughout; `record` is not used."""
    return Motion(np.zeros((sample_times(parameters.duration, sample_time).size, 3)), {})
