"""Node `controller`: reference and estimate → valve command.

Where they are switched on, harmonics are added to a periodic reference, learnt from the acceleration that the sensors
show, and the specimen on the table is followed for the controller's virtual table.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from shake_ros.control.laws import CONTROLLERS, harmonic_cancellation
from shake_ros.control.laws.harmonic_cancellation import HarmonicCancellation
from shake_ros.control.laws.runner import Controller, refuse_another_instant, switch
from shake_ros.control.observer.law import work
from shake_ros.control.observer.load import PITCH, RIGID, SWAYING, LoadTracker, LoadTracking, track
from shake_ros.packing import numbers
from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND, Values
from shake_ros.ros.diagnostics import ERROR, OK, WARN
from shake_ros.ros.frame import Behaviour, Frame, Reader
from shake_ros.ros.graph_client import TABLES, reports_in
from shake_ros.ros.parameters import LiveLaw, Sets, variants
from shake_ros.settings import load_parameters, load_table


class AddedHarmonics:
    """Reads the accelerometer from the first time that it is switched on.

    Parameters
    ----------
    on_sample : called with the stamp [ns] of each acceleration while it is on.
    """

    def __init__(self, frame: Frame, on_sample: Callable[[int], None]) -> None:
        self._frame = frame
        self._on_sample = on_sample
        configured = load_parameters("harmonic_cancellation", "default", HarmonicCancellation)
        self._live = frame.parameters.declare(configured, "harmonics.")
        self._on = self._reads = False
        self._state: Any = None
        self._acceleration, self._stamp, self._origin = 0.0, -1, -1

    def switch(self, wanted: bool) -> None:
        """On or off; a new start has learnt nothing."""
        if wanted and not self._reads:
            Reader(self._frame, interface.IMU, self._on_acceleration)
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
            self._on_sample(stamp)

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


SILENT = 0.05  # [s] without a position or an acceleration, in real time, after which the load is not followed


class FollowedLoad:
    """Reads position and accelerometer; what is followed stands on /diagnostics with its standard errors.

    The virtual table keeps the last load where a sensor falls silent in real time, or while the table takes no command;
    then the search begins anew. In lock-step it takes position and acceleration of sample k, and waits for them.

    Parameters
    ----------
    name : configuration in config/load, or a YAML file; empty to follow nothing.
    on_sample : called with the stamp [ns] of each position and acceleration.
    """

    def __init__(self, frame: Frame, name: str, on_sample: Callable[[int], None]) -> None:
        self._frame, self._on_sample, self._on = frame, on_sample, bool(name)
        self._tracker: LoadTracker | None = None
        self._model: Any = None
        self._state: Any = None
        self._work = work()
        self._position = self._acceleration = 0.0
        self._stamps = {"position": -1, "acceleration": -1}
        self._silent = False
        if self._on:
            self._settings = load_parameters("load", name, LoadTracking)
            Reader(frame, interface.JOINT_STATES, self._on_position)
            Reader(frame, interface.IMU, self._on_acceleration)
            for key, place in (("load_rigid_kg", RIGID), ("load_swaying_kg", SWAYING), ("load_frequency_hz", PITCH)):
                frame.diagnostics.values[key] = functools.partial(self._reported, place)
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
        self._on_sample(stamp)

    def _on_acceleration(self, stamp: int, acceleration: float) -> None:
        self._acceleration, self._stamps["acceleration"] = acceleration, stamp
        self._on_sample(stamp)

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
            controller.virtual.carry_load(*self._state.reported.tolist())

    def _track(self, command: float) -> None:
        assert self._tracker is not None
        given = self._position, self._acceleration, command
        track(self._state, self._tracker.fixed, self._model, *given, self._work)

    def _reported(self, place: int) -> str:
        """A number of the reported load, with the best tracker's standard error."""
        state = self._state
        if state is None:
            return "not followed"
        value, error = float(state.reported[place]), float(np.sqrt(state.covariance[state.leader[0], place, place]))
        if place == PITCH:
            value = math.exp(value)
            error *= value
        return f"{value:.3g} ± {error:.2g}"

    def _believed(self) -> bool:
        return self._state is not None and bool(self._state.believed[0])

    def text(self) -> str:
        """For the node's line on /diagnostics; empty where all is well or nothing is followed."""
        return ", the load is not followed: no position or accelerometer" if self._silent else ""


REST = (0.0, 0.0, 0.0)
TO_FOLLOW = 2.0  # [s] that observer and controller may be apart while both are given another table


@dataclass(frozen=True)
class ControllerNodeParameters(Parameters):
    """The node's own settings; gains and limit come from the controller's configuration."""

    controller: str = choice("configuration in config/controller, or a YAML file", live=True)
    switch_time: float = quantity(
        "s", "time over which the difference at a change of controller fades", low=0.01, high=10.0
    )
    stale_after: float = quantity("s", "an older reference is followed as a position at rest", low=0.001, high=10.0)
    harmonic_cancellation: bool = choice("whether harmonics are added to a periodic reference", live=True)
    load: str = choice("configuration in config/load for following the specimen, empty for none")


class ControllerNode(Behaviour):
    """Command k from reference k and estimate k (lock-step), or from estimate k and the newest reference.

    In real time it rests at a command of zero while the table's interlock lets none pass, so that no integral winds up;
    then it begins anew, without a bump. In lock-step it does not: what comes outside the samples would change a run.

    With `harmonic_cancellation` it reads the accelerometer as well; in lock-step that of sample k. With `load` it reads
    position and accelerometer, and its virtual table carries the specimen that they show.
    """

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self._own = frame.settings(ControllerNodeParameters)
        own = self._own.value
        self._law = LiveLaw(
            frame.parameters, "controller", self._own, variants("controller", CONTROLLERS), self._make, live=False
        )
        self._controller = self._law.take()[0]
        self._state: Any = self._controller.initial_state()
        self._u = 0.0
        self._stale_after = round(own.stale_after * SECOND)
        self._reference: Values = REST
        self._estimate: Values = REST
        self._reference_stamp = self._estimate_stamp = -1
        self._limited = 0
        self._rests = False
        self._space = frame.node.get_namespace().strip("/")
        if not frame.lockstep:
            topic = interface.DIAGNOSTICS
            frame.node.create_subscription(topic.type, topic.name, self._on_diagnostics, topic.qos(False))
        self._writer = frame.writer(interface.VALVE_COMMAND)
        Reader(frame, interface.REFERENCE, self._on_reference)
        self._estimates = Reader(frame, interface.ESTIMATE, self._on_estimate)
        self._agreed = False  # whether an estimate was for the instant that the controller expects
        self._apart = 0  # samples in a row that did not
        self._harmonics = AddedHarmonics(frame, self._step_when_complete)
        self._harmonics.switch(own.harmonic_cancellation)
        self._load = FollowedLoad(frame, own.load, self._step_when_complete)
        self._load.serve(self._controller)
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values["limited"] = lambda: self._limited

    def _make(self, kind: str, sets: Sets) -> Controller:
        """A controller that has been compiled, so that its first sample is not late."""
        table = load_table(sets[""].model) if sets[""].model else None
        controller = Controller(kind, sets[""], self.frame.sample_time, table)
        if self._own.value.load and controller.model is None:
            raise ShakeError(f"load: the controller '{kind}' has no table model, so no specimen can be followed")
        controller.step(controller.initial_state(), REST, REST)
        return controller

    def _on_reference(self, stamp: int, *reference: float) -> None:
        self._reference, self._reference_stamp = reference, stamp
        self._step_when_complete(stamp)

    def _on_estimate(self, stamp: int, *estimate: float) -> None:
        self._estimate, self._estimate_stamp = estimate, stamp
        if self.frame.lockstep:
            self._step_when_complete(stamp)
        elif self._reference_stamp >= 0:
            if stamp - self._reference_stamp > self._stale_after:
                self._reference = (self._reference[0], 0.0, 0.0)
            self._step(stamp)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Whether the interlock of this graph's table lets commands pass."""
        for report in reports_in(message, self._space):
            if report.part in TABLES:
                self._rests = report.values.get("passes") == "False"

    def _step_when_complete(self, stamp: int) -> None:
        """In lock-step: the command of a sample whose reference, estimate and acceleration (if needed) have come."""
        complete = stamp == self._reference_stamp == self._estimate_stamp
        if self.frame.lockstep and complete and self._harmonics.has(stamp) and self._load.has(stamp):
            self._step(stamp)

    def _change(self) -> None:
        """Take changed parameters over, between two samples."""
        own = self._own.take()
        new, renamed = self._law.take()
        if renamed or len(self._state) != len(new.initial_state()):
            self._state = switch(self._controller, self._state, new, self._u, own.switch_time)
        self._load.serve(new)
        self._controller = new
        self._harmonics.switch(own.harmonic_cancellation)

    def _step(self, stamp: int) -> None:
        if self._law.changed or self._own.changed:
            self._change()
        self._check_instant()
        wanted = self._harmonics.added(stamp, self._reference)
        if self._rests:
            self._load.pause()
            self._state, self._u = self._controller.initial_state(), 0.0
        else:
            self._load.step(stamp, self._u, self._controller)
            self._state, self._u = self._controller.step(self._state, wanted, self._estimate)
        self._writer.send(stamp, self._u)
        self._limited += abs(self._u) >= self._controller.parameters.limit
        diagnostics = self.frame.diagnostics
        diagnostics.cycles += 1
        if not self.frame.lockstep:
            diagnostics.latency(self.frame.now() - stamp)
        self.frame.pause.begins()

    def _check_instant(self) -> None:
        """An estimate of another instant ends the node at its start; the observer may change `TO_FOLLOW` before it."""
        try:
            refuse_another_instant(self._estimates.codec.lead / SECOND, self._controller)
        except ShakeError:
            self._apart += 1
            if not self._agreed or self._apart * self.frame.sample_time > TO_FOLLOW:
                raise
        else:
            self._agreed, self._apart = True, 0

    def _condition(self) -> tuple[int, str]:
        if self._reference_stamp < 0 or self._estimate_stamp < 0:
            missing = "reference" if self._reference_stamp < 0 else "estimate"
            return WARN, f"waiting for the first {missing}"
        if self._apart:
            return ERROR, "the estimate is for another instant than the controller predicts to"
        state = "at rest, the table accepts no commands" if self._rests else "running"
        return WARN if self._load.text() else OK, f"{self._controller.kind}: {state}{self._load.text()}"


build = ControllerNode
