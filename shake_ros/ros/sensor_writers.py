"""The sensors' topics, of the plant as of a real table."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from shake_ros.core.plant.parameters import SensorParameters
from shake_ros.ros import interface
from shake_ros.ros.frame import Frame

TOPICS = {
    "position": interface.JOINT_STATES,
    "acceleration": interface.IMU,
    "pressure_a": interface.PRESSURE_A,
    "pressure_b": interface.PRESSURE_B,
    "pressure_supply": interface.PRESSURE_SUPPLY,
}


class SensorWriters:
    """A writer for each sensor that is there."""

    def __init__(self, frame: Frame, present: Collection[str] = tuple(TOPICS)) -> None:
        self._writers = {name: frame.writer(topic) for name, topic in TOPICS.items() if name in present}

    def send(self, stamp: int, readings: Mapping[str, float]) -> None:
        """What the sensors say at `stamp` [ns]; one whose cable is off says NaN, and nothing is published."""
        for name, writer in self._writers.items():
            value = readings[name]
            if not math.isnan(value):
                writer.send(stamp, value)

    def tell_noise(self, sensors: SensorParameters) -> None:
        """What the messages say of the sensors' noise: variances [unit²]."""
        pressure = sensors.pressure_noise**2
        variances = dict.fromkeys(("pressure_a", "pressure_b", "pressure_supply"), pressure)
        variances["acceleration"] = sensors.acceleration_noise**2
        for name, writer in self._writers.items():
            writer.codec.variance = variances.get(name, 0.0)
