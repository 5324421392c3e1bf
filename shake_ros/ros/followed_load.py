"""The specimen on the table, followed while it runs, for the controller's virtual table; off without a name."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from shake_ros.core.control.runner import Controller
from shake_ros.core.observer.carried import work
from shake_ros.core.observer.load import PITCH, RIGID, SWAYING, LoadTracker, LoadTracking, track
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Frame
from shake_ros.settings import find, read_yaml

SILENT = 0.05  # [s] without a position or an acceleration, in real time, after which the load is not followed


class FollowedLoad:
    """Reads position and accelerometer; what is followed stands on /diagnostics with its standard errors.

    The virtual table keeps the last load where a sensor falls silent in real time, or while the table takes no command;
    then the search begins anew. In lock-step it takes position and acceleration of sample k, and waits for them.

    Parameters
    ----------
    name : configuration in config/load, or a YAML file; empty to follow nothing.
    heard : called with the stamp [ns] of each position and acceleration.
    """

    def __init__(self, frame: Frame, name: str, heard: Callable[[int], None]) -> None:
        self._frame, self._heard, self._on = frame, heard, bool(name)
        self._tracker: LoadTracker | None = None
        self._model: Any = None
        self._state: Any = None
        self._work = work()
        self._position = self._acceleration = 0.0
        self._stamps = {"position": -1, "acceleration": -1}
        self._silent = False
        if self._on:
            path = find("load", name)
            self._settings = LoadTracking.from_mapping(read_yaml(path), str(path))
            frame.reader(interface.JOINT_STATES, self._on_position)
            frame.reader(interface.IMU, self._on_acceleration)
            for key, place in (("load_rigid_kg", RIGID), ("load_swaying_kg", SWAYING), ("load_frequency_hz", PITCH)):
                frame.diagnostics.values[key] = functools.partial(self._told, place)
            frame.diagnostics.values["load_believed"] = self._believed

    def serve(self, controller: Controller) -> None:
        """Follow the load for this controller, with the table that it carries; compiles before the first sample."""
        known = self._tracker is not None and controller.model == self._tracker.table
        if not self._on or controller.model is None or known:
            return
        self._tracker = LoadTracker(self._settings, controller.model, controller.sample_time)
        self._model = self._tracker.model.copy()
        self._state = self._tracker.initial_state()
        self._track(0.0)
        self._state = None

    def _on_position(self, stamp: int, position: float) -> None:
        self._position, self._stamps["position"] = position, stamp
        self._heard(stamp)

    def _on_acceleration(self, stamp: int, acceleration: float) -> None:
        self._acceleration, self._stamps["acceleration"] = acceleration, stamp
        self._heard(stamp)

    def has(self, stamp: int) -> bool:
        """Whether position and acceleration of this instant [ns] have come, where they are needed."""
        return not self._on or all(one == stamp for one in self._stamps.values())

    def pause(self) -> None:
        """The table takes no command: what its copies do says nothing of the load."""
        self._state = None

    def step(self, stamp: int, command: float, controller: Controller) -> None:
        """One sample at an instant [ns] under the command that has been held since the one before [-]."""
        if not self._on or self._tracker is None:
            return
        silent = stamp - min(self._stamps.values()) > SILENT * SECOND
        if silent != self._silent:
            self._silent = silent
            text = "not followed without position and accelerometer" if silent else "followed again"
            self._frame.say(WARN if silent else OK, f"controller: the load is {text}")
        if silent:
            self._state = None
            return
        if self._state is None:
            self._state = self._tracker.initial_state(self._position)
        self._track(command)
        if controller.virtual is not None:
            controller.virtual.carry_load(*self._state.told.tolist())

    def _track(self, command: float) -> None:
        assert self._tracker is not None
        given = self._position, self._acceleration, command
        track(self._state, self._tracker.fixed, self._model, *given, self._work)

    def _told(self, place: int) -> str:
        """A number of the load that is told, with the leader's standard error."""
        state = self._state
        if state is None:
            return "not followed"
        value, error = float(state.told[place]), float(np.sqrt(state.covariance[state.leader[0], place, place]))
        if place == PITCH:
            value = math.exp(value)
            error *= value
        return f"{value:.3g} ± {error:.2g}"

    def _believed(self) -> bool:
        return self._state is not None and bool(self._state.believed[0])

    def text(self) -> str:
        """For the node's line on /diagnostics; empty where all is well or nothing is followed."""
        return ", the load is not followed: no position or accelerometer" if self._silent else ""
