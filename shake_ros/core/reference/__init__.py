"""References: what the table is asked to do. One file per kind, listed in the tables below.

To add one: a file with a frozen `Parameters` class and a function `motion(parameters, sample_time, record) →
Motion`, a line in each of the two tables, a config/reference/*.yaml, and it is under test.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from shake_ros.core.quantities import Parameters
from shake_ros.core.reference import (
    drive,
    earthquake,
    multisine,
    none,
    pulse,
    random_binary,
    sine,
    sine_beat,
    step,
    sweep,
)
from shake_ros.core.reference.motion import Motion

REFERENCES: dict[str, type[Parameters]] = {
    "sine": sine.SineParameters,
    "sine_beat": sine_beat.SineBeatParameters,
    "multisine": multisine.MultisineParameters,
    "sweep": sweep.SweepParameters,
    "pulse": pulse.PulseParameters,
    "random_binary": random_binary.RandomBinaryParameters,
    "step": step.StepParameters,
    "earthquake": earthquake.EarthquakeParameters,
    "drive": drive.DriveParameters,
    "none": none.NoneParameters,
}

MOTIONS: dict[str, Callable[[Any, float, Any], Motion]] = {
    "sine": sine.motion,
    "sine_beat": sine_beat.motion,
    "multisine": multisine.motion,
    "sweep": sweep.motion,
    "pulse": pulse.motion,
    "random_binary": random_binary.motion,
    "step": step.motion,
    "earthquake": earthquake.motion,
    "drive": drive.motion,
    "none": none.motion,
}
