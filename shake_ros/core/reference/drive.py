"""Drive: an acceleration that begins and ends at rest, played as it is; nothing is corrected, filtered or limited.

What `iterate` and `qualify` make is such a drive: its velocity and displacement follow by integrals that are exact for
an acceleration linear between samples. `earthquake` is for records, whose baseline has to be corrected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.core.reference.baseline import resample
from shake_ros.core.reference.motion import EarthquakeRecord, Motion, sample_times

REST = 1.0  # length of what is played without a record [s]
AT_REST = 1e-4  # of the largest velocity, and of the largest displacement, that may be left at the end
UNITS = ("", "m/s2", "cm/s2", "g")


@dataclass(frozen=True)
class DriveParameters(Parameters):
    record: str = choice("path of the drive's accelerations; empty = the table rests")
    channel: int = quantity(
        "-", "channel of an accelerogram that has several, from 1; 0 = it has one", low=0, high=1000
    )
    unit: str = choice("unit of an accelerogram that names none; empty = as the file says", UNITS)
    scale: float = quantity("-", "factor on the acceleration", low=0.0, high=1e4, live=True)


def motion(parameters: DriveParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """The drive as displacement, velocity and acceleration.

    Raises ShakeError for one that is too short, not finite, not uniform, or does not end at rest where it began.
    """
    if record is None:
        if parameters.record:
            raise ShakeError(f"drive: record '{parameters.record}' was named but not given")
        return Motion(np.zeros((sample_times(REST, sample_time).size, 3)), {})
    time, acceleration = record
    if time.shape != acceleration.shape or time.size < 8 or not np.isfinite(time + acceleration).all():
        raise ShakeError("drive: at least 8 samples are needed, all finite")
    step = float(time[-1] - time[0]) / (time.size - 1)
    if step <= 0.0 or np.max(np.abs(np.diff(time) - step)) > 0.01 * step:
        raise ShakeError("drive: its samples are not uniform in time")
    states = resample(parameters.scale * acceleration, step, sample_time)
    largest = np.max(np.abs(states), axis=0)
    for name, column in (("displacement", 0), ("velocity", 1)):
        if abs(states[-1, column]) > AT_REST * largest[column]:
            share = 100.0 * abs(states[-1, column]) / largest[column]
            raise ShakeError(
                f"drive: {share:.2g} % of its {name} is left at its end; an accelerogram is played as `earthquake`"
            )
    states[-1, 1:] = 0.0
    return Motion(states, {"source": parameters.record})
