"""Node `thd_analyzer`: acceleration → total harmonic distortion and harmonics over whole periods, live."""

from __future__ import annotations

import math
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from shake_ros.quantities import Parameters, ShakeError, quantity
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND, time_message
from shake_ros.ros.diagnostics import OK, WARN, status_of
from shake_ros.ros.frame import Behaviour, Frame, Reader
from shake_ros.signals.newest_samples import NewestSamples
from shake_ros.signals.thd import Harmonics

COLUMNS = "order, frequency [Hz], amplitude [m/s^2], phase [rad]"
AXIS = "x"


@dataclass(frozen=True)
class ThdParameters(Parameters):
    """The node's settings."""

    frequency: float = quantity("Hz", "fundamental, 0 to find it", low=0.0, high=1e4, live=True)
    periods: int = quantity("-", "whole periods in a window", low=1, high=10000, live=True)
    capacity: float = quantity("s", "samples kept to find them", low=0.05, high=600.0)
    update_period: float = quantity("s", "between two results", low=0.01, high=600.0, live=True)
    orders: int = quantity("-", "harmonics to fit", low=1, high=200, live=True)


class ThdAnalyzer(Behaviour):
    """Keeps the newest samples; every so many of them, publishes what they hold."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self._live = frame.settings(ThdParameters)
        capacity = max(8, round(self._live.value.capacity / frame.sample_time))
        self._acceleration = NewestSamples(capacity, frame.sample_time)
        self._reference = NewestSamples(capacity, frame.sample_time)
        self._since_update = 0
        self._state = WARN, "no whole window yet"
        self._thd, self._harmonics = frame.publisher(interface.THD), frame.publisher(interface.HARMONICS)
        Reader(frame, interface.IMU, self._on_acceleration)
        Reader(frame, interface.REFERENCE, lambda stamp, *motion: self._reference.add(stamp, motion[2]))
        frame.diagnostics.condition = lambda: self._state
        frame.diagnostics.values["window_restarts"] = lambda: self._acceleration.restarts

    def _on_acceleration(self, stamp: int, acceleration: float) -> None:
        self._acceleration.add(stamp, acceleration)
        self.frame.diagnostics.cycles += 1
        self._since_update += 1
        if self._since_update >= self._live.value.update_period / self.frame.sample_time:
            self._since_update = 0
            self._update(stamp)

    def _update(self, stamp: int) -> None:
        settings = self._live.take()
        try:
            frequency = settings.frequency or self._fundamental()
            found = self._acceleration.harmonics(settings.periods, frequency, settings.orders)
        except ShakeError as error:
            self._state = WARN, str(error)
            return
        if found is None:
            restarts, reason = self._acceleration.restarts, self._acceleration.reason
            why = f"; restarted {restarts} times, the last time for {reason}" if restarts else ""
            self._state = WARN, f"no whole window yet{why}"
            return
        self._state = OK, f"THD {100.0 * found.thd:.2f} % at {found.frequency:.4g} Hz"
        self._thd.publish(thd_message(stamp, found, self.frame.node.get_fully_qualified_name().lstrip("/")))
        self._harmonics.publish(harmonics_message(stamp, found))

    def _fundamental(self) -> float | None:
        """Of the reference where it is there and periodic; None leaves it to the acceleration."""
        try:
            return self._reference.fundamental()
        except ShakeError:
            return None


def thd_message(stamp: int, found: Harmonics, hardware: str) -> DiagnosticArray:
    """THD [%], fundamental, noise floor and window of one axis."""
    values = {
        "axis": AXIS,
        "thd_percent": 100.0 * found.thd,
        "fundamental_frequency_hz": found.frequency,
        "fundamental_amplitude_m_s2": float(found.amplitude[0]),
        "noise_floor_m_s2": found.floor,
        "window_s": found.stop - found.start,
        "periods": found.periods,
        "samples": found.samples,
    }
    digits = {key: value if isinstance(value, str) else f"{value:.9g}" for key, value in values.items()}
    status = status_of(f"thd {AXIS}", hardware, OK, f"THD {100.0 * found.thd:.3f} %", digits)
    message = DiagnosticArray(status=[status])
    message.header.stamp = time_message(stamp)
    return message


def harmonics_message(stamp: int, found: Harmonics) -> Float64MultiArray:
    """Rows of order, frequency [Hz], amplitude [m/s²], phase at the window's first sample [rad].

    This type has no header: the stamp of the window's last sample is the label of a third dimension, of size 1.
    """
    message = Float64MultiArray()
    count = len(found.amplitude)
    message.layout.dim = [
        MultiArrayDimension(label="harmonic", size=count, stride=4 * count),
        MultiArrayDimension(label=COLUMNS, size=4, stride=4),
        MultiArrayDimension(label=f"stamp {stamp // SECOND}.{stamp % SECOND:09d} s", size=1, stride=1),
    ]
    for k, amplitude, phase in zip(found.orders, found.amplitude, found.phase, strict=True):
        at_start = phase + 2.0 * math.pi * found.frequency * int(k) * found.start
        message.data.extend(
            [float(k), float(k) * found.frequency, float(amplitude), math.remainder(at_start, math.tau)]
        )
    return message


build = ThdAnalyzer
