"""References: what the table is asked to do; motions in closed form, periodic excitations, accelerations from a file.

To add one: a frozen `ReferenceParameters` class with its `motion`, in the file of its kind, a row in the table below, a
config/reference/*.yaml, and it is under test.
"""

from __future__ import annotations

from shake_ros.control.reference.motion import ReferenceParameters
from shake_ros.control.reference.recorded import DriveParameters, EarthquakeParameters
from shake_ros.control.reference.waves import (
    MultisineParameters,
    NoneParameters,
    PulseParameters,
    RandomBinaryParameters,
    SineBeatParameters,
    SineParameters,
    StepParameters,
    SweepParameters,
)

REFERENCES: dict[str, type[ReferenceParameters]] = {
    "sine": SineParameters,
    "sine_beat": SineBeatParameters,
    "multisine": MultisineParameters,
    "sweep": SweepParameters,
    "pulse": PulseParameters,
    "random_binary": RandomBinaryParameters,
    "step": StepParameters,
    "earthquake": EarthquakeParameters,
    "drive": DriveParameters,
    "none": NoneParameters,
}
