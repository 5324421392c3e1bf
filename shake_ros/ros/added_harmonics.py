"""Harmonics added to a periodic reference, learnt from the acceleration that the sensors show; on or off."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from shake_ros.core.control import harmonic_cancellation
from shake_ros.core.control.harmonic_cancellation import HarmonicCancellation
from shake_ros.core.packing import numbers
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND, Values
from shake_ros.ros.frame import Frame
from shake_ros.settings import find, read_yaml


class AddedHarmonics:
    """Reads the accelerometer from the first time that it is switched on.

    Parameters
    ----------
    heard : called with the stamp [ns] of each acceleration while it is on.
    """

    def __init__(self, frame: Frame, heard: Callable[[int], None]) -> None:
        self._frame = frame
        self._heard = heard
        path = find("harmonic_cancellation", "default")
        configured = HarmonicCancellation.from_mapping(read_yaml(path), str(path))
        self._live = frame.parameters.declare(configured, "harmonics.")
        self._on = self._reads = False
        self._state: Any = None
        self._acceleration, self._stamp, self._origin = 0.0, -1, -1

    def switch(self, wanted: bool) -> None:
        """On or off; a new start has learnt nothing."""
        if wanted and not self._reads:
            self._frame.reader(interface.IMU, self._on_acceleration)
            self._reads = True
        if wanted and not self._on:
            parameters = self._live.take()
            self._state = harmonic_cancellation.initial_state(parameters)
            packed = numbers(parameters)
            harmonic_cancellation.step(self._state, packed, 0.0, np.zeros(3), 0.0)  # compiles before the first sample
        self._on = wanted

    def _on_acceleration(self, stamp: int, acceleration: float) -> None:
        self._acceleration, self._stamp = acceleration, stamp
        if self._on:
            self._heard(stamp)

    def has(self, stamp: int) -> bool:
        """Whether the acceleration of this instant [ns] has come, where it is needed."""
        return not self._on or stamp == self._stamp

    def added(self, stamp: int, reference: Values) -> Any:
        """The reference of an instant [ns] with what cancels the harmonics, where that is on."""
        if not self._on or self._stamp < 0:
            return reference
        if self._origin < 0:
            self._origin = stamp
        packed, time = numbers(self._live.value), (stamp - self._origin) / SECOND
        wanted = np.array(reference, dtype=np.float64)
        self._state, corrected = harmonic_cancellation.step(self._state, packed, time, wanted, self._acceleration)
        return corrected
