"""Node `controller`: reference and estimate → valve command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from shake_ros.core.control import CONTROLLERS, harmonic_cancellation
from shake_ros.core.control.harmonic_cancellation import HarmonicCancellation
from shake_ros.core.control.runner import Controller, switch
from shake_ros.core.quantities import Parameters, choice, quantity
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Frame, node_settings
from shake_ros.settings import find, load_table, load_variant, read_yaml

REST = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ControllerNodeParameters(Parameters):
    """The node's own settings; gains and limit come from the controller's configuration."""

    controller: str = choice("configuration in config/controller, or a YAML file", live=True)
    switch_time: float = quantity("s", "time in which the bump of a change of controller fades", low=0.01, high=10.0)
    stale_after: float = quantity("s", "an older reference is followed as a position at rest", low=0.001, high=10.0)
    harmonic_cancellation: bool = choice("whether harmonics are added to a periodic reference", live=True)


class ControllerNode:
    """Command k from reference k and estimate k (lock-step), or from estimate k and the newest reference.

    With `harmonic_cancellation` it reads the accelerometer as well; in lock-step that of sample k.
    """

    ticks = False

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        settings = ControllerNodeParameters.from_mapping(node_settings("controller"), "config/node/controller.yaml")
        self._controller: Any = None
        self._own = frame.parameters.declare(settings, accept=self._accept)
        own = self._own.value
        kind, configured = load_variant("controller", own.controller, CONTROLLERS)
        self._live = frame.parameters.declare(configured, accept=lambda p: self._make(kind, p))
        path = find("harmonic_cancellation", "default")
        added = HarmonicCancellation.from_mapping(read_yaml(path), str(path))
        self._harmonics = frame.parameters.declare(added, prefix="harmonics.")
        self._first = self._name = own.controller
        self._controller = self._next = self._make(kind, self._live.take())
        self._state: Any = self._controller.initial_state()
        self._u = 0.0
        self._cancelling = self._imu = False
        self._added: Any = None
        self._stale_after = round(own.stale_after * SECOND)
        self._reference, self._reference_stamp = REST, -1
        self._estimate, self._estimate_stamp = REST, -1
        self._acceleration, self._acceleration_stamp, self._origin = 0.0, -1, -1
        self._limited = 0
        self._writer = frame.writer(interface.VALVE_COMMAND)
        frame.reader(interface.REFERENCE, self._on_reference)
        frame.reader(interface.ESTIMATE, self._on_estimate)
        self._cancel(own.harmonic_cancellation)
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values["limited"] = lambda: self._limited

    def _make(self, kind: str, parameters: Any) -> Controller:
        """A controller that has been compiled, so that its first sample is not late."""
        named = getattr(parameters, "model", "")
        controller = Controller(kind, parameters, self.frame.sample_time, load_table(named) if named else None)
        controller.step(controller.initial_state(), REST, REST)
        return controller

    def _accept(self, settings: ControllerNodeParameters) -> None:
        """Get the named controller ready while the present one still runs; at the start the constructor does it."""
        if self._controller is not None and settings.controller != self._name:
            self._next = self._make(*load_variant("controller", settings.controller, CONTROLLERS))

    def _cancel(self, wanted: bool) -> None:
        """Start or end harmonic cancellation; a new start has learnt nothing."""
        if wanted and not self._imu:
            self.frame.reader(interface.IMU, self._on_acceleration)
            self._imu = True
        if wanted and not self._cancelling:
            parameters = self._harmonics.take()
            self._added = harmonic_cancellation.initial_state(parameters)
            harmonic_cancellation.step(
                self._added, harmonic_cancellation.pack(parameters), 0.0, np.zeros(3), 0.0
            )  # compiles before the first sample
        self._cancelling = wanted

    def start(self) -> None:
        """Waits for the first reference and estimate."""

    def finish(self) -> None:
        """Nothing to put away."""

    def tick(self, stamp: int, steps: int) -> None:
        """Keeps no time of its own."""

    def _on_reference(self, stamp: int, *reference: float) -> None:
        self._reference, self._reference_stamp = reference, stamp
        self._step_when_complete(stamp)

    def _on_acceleration(self, stamp: int, acceleration: float) -> None:
        self._acceleration, self._acceleration_stamp = acceleration, stamp
        if self._cancelling:
            self._step_when_complete(stamp)

    def _on_estimate(self, stamp: int, *estimate: float) -> None:
        self._estimate, self._estimate_stamp = estimate, stamp
        if self.frame.lockstep:
            self._step_when_complete(stamp)
        elif self._reference_stamp >= 0:
            if stamp - self._reference_stamp > self._stale_after:
                self._reference = (self._reference[0], 0.0, 0.0)
            self._step(stamp)

    def _step_when_complete(self, stamp: int) -> None:
        """In lock-step: the command of a sample whose reference, estimate and acceleration (if needed) have come."""
        complete = stamp == self._reference_stamp == self._estimate_stamp
        if self._cancelling:
            complete = complete and stamp == self._acceleration_stamp
        if self.frame.lockstep and complete:
            self._step(stamp)

    def _change(self) -> None:
        """Take changed parameters over, between two samples."""
        if self._live.changed and self._name == self._first:
            self._controller = self._make(self._controller.kind, self._live.take())
        if self._own.changed:
            own = self._own.take()
            if own.controller != self._name:
                new, self._name = self._next, own.controller
                self._state = switch(self._controller, self._state, new, self._u, own.switch_time)
                self._controller = new
            self._cancel(own.harmonic_cancellation)

    def _wanted(self, stamp: int) -> Any:
        """The reference, with harmonics added where they are cancelled."""
        if not self._cancelling or self._acceleration_stamp < 0:
            return self._reference
        if self._origin < 0:
            self._origin = stamp
        packed = harmonic_cancellation.pack(self._harmonics.value)
        reference = np.array(self._reference, dtype=np.float64)
        time = (stamp - self._origin) / SECOND
        self._added, corrected = harmonic_cancellation.step(self._added, packed, time, reference, self._acceleration)
        return corrected

    def _step(self, stamp: int) -> None:
        if self._live.changed or self._own.changed:
            self._change()
        self._state, self._u = self._controller.step(self._state, self._wanted(stamp), self._estimate)
        self._writer.send(stamp, self._u)
        self._limited += abs(self._u) >= self._controller.parameters.limit
        diagnostics = self.frame.diagnostics
        diagnostics.cycles += 1
        if not self.frame.lockstep:
            diagnostics.latency(self.frame.now() - stamp)

    def _condition(self) -> tuple[int, str]:
        if self._reference_stamp < 0 or self._estimate_stamp < 0:
            missing = "reference" if self._reference_stamp < 0 else "estimate"
            return WARN, f"waiting for the first {missing}"
        return OK, f"{self._controller.kind}: running"


def build(frame: Frame) -> ControllerNode:
    """The node in its frame."""
    return ControllerNode(frame)
