"""Node `controller`: reference and estimate → valve command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from shake_ros.core.control import CONTROLLERS
from shake_ros.core.control.runner import Controller, refuse_another_instant, switch
from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.ros import interface
from shake_ros.ros.added_harmonics import AddedHarmonics
from shake_ros.ros.conversions import SECOND, Values
from shake_ros.ros.diagnostics import ERROR, OK, WARN
from shake_ros.ros.followed_load import FollowedLoad
from shake_ros.ros.frame import Behaviour, Frame
from shake_ros.ros.lab_watch import TABLES
from shake_ros.ros.live_law import LiveLaw, Sets, variants
from shake_ros.settings import load_table

REST = (0.0, 0.0, 0.0)
TO_FOLLOW = 2.0  # [s] that observer and controller may be apart while both are given another table


@dataclass(frozen=True)
class ControllerNodeParameters(Parameters):
    """The node's own settings; gains and limit come from the controller's configuration."""

    controller: str = choice("configuration in config/controller, or a YAML file", live=True)
    switch_time: float = quantity("s", "time in which the bump of a change of controller fades", low=0.01, high=10.0)
    stale_after: float = quantity("s", "an older reference is followed as a position at rest", low=0.001, high=10.0)
    harmonic_cancellation: bool = choice("whether harmonics are added to a periodic reference", live=True)
    load: str = choice("configuration in config/load by which the specimen is followed, empty for none")


class ControllerNode(Behaviour):
    """Command k from reference k and estimate k (lock-step), or from estimate k and the newest reference.

    In real time it rests at a command of zero while the table's interlock lets none pass, so that no integral winds up;
    then it begins anew, without a bump. In lock-step it does not: what comes outside the samples would change a run.

    With `harmonic_cancellation` it reads the accelerometer as well; in lock-step that of sample k. With `load` it reads
    position and accelerometer, and its virtual table carries the specimen that they tell.
    """

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self._own = frame.settings(ControllerNodeParameters)
        own = self._own.value
        self._law = LiveLaw(frame, "controller", self._own, variants("controller", CONTROLLERS), self._make, live=False)
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
        frame.reader(interface.REFERENCE, self._on_reference)
        self._estimates = frame.reader(interface.ESTIMATE, self._on_estimate)
        self._agreed = False  # whether an estimate has stood at the instant that the controller takes it for
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
            raise ShakeError(f"load: the controller '{kind}' carries no table whose specimen could be followed")
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
        for status in message.status:
            node, _, part = status.name.partition(": ")
            if part in TABLES and node.rpartition("/")[0] == self._space:
                self._rests = any(one.key == "passes" and one.value == "False" for one in status.values)

    def _step_when_complete(self, stamp: int) -> None:
        """In lock-step: the command of a sample whose reference, estimate and acceleration (if needed) have come."""
        complete = stamp == self._reference_stamp == self._estimate_stamp
        if self.frame.lockstep and complete and self._harmonics.has(stamp) and self._load.has(stamp):
            self._step(stamp)

    def _change(self) -> None:
        """Take changed parameters over, between two samples."""
        own = self._own.take()
        new, renamed = self._law.take()
        if renamed:
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
            return ERROR, "the estimate stands at another instant than the controller predicts to"
        state = "at rest, the table takes no command" if self._rests else "running"
        return WARN if self._load.text() else OK, f"{self._controller.kind}: {state}{self._load.text()}"


build = ControllerNode
