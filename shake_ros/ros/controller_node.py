"""Node `controller`: reference and estimate → valve command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from shake_ros.core.control import CONTROLLERS
from shake_ros.core.control.runner import Controller
from shake_ros.core.quantities import Parameters, choice, quantity
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Frame, node_settings
from shake_ros.settings import load_table, load_variant

REST = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ControllerNodeParameters(Parameters):
    """The node's own settings; gains and limit come from the controller's configuration."""

    controller: str = choice("configuration in config/controller, or a YAML file")
    stale_after: float = quantity("s", "an older reference is followed as a position at rest", low=0.001, high=10.0)


class ControllerNode:
    """Command k from reference k and estimate k (lock-step), or from estimate k and the newest reference."""

    ticks = False

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        settings = ControllerNodeParameters.from_mapping(node_settings("controller"), "config/node/controller.yaml")
        own = frame.parameters.declare(settings).value
        self._kind, configured = load_variant("controller", own.controller, CONTROLLERS)
        self._live = frame.parameters.declare(configured, accept=self._make)
        self._controller = self._make(self._live.take())
        self._controller.step(self._controller.initial_state(), REST, REST)  # compiles before the first sample
        self._state: Any = self._controller.initial_state()
        self._stale_after = round(own.stale_after * SECOND)
        self._reference, self._reference_stamp = REST, -1
        self._estimate, self._estimate_stamp = REST, -1
        self._limited = 0
        self._writer = frame.writer(interface.VALVE_COMMAND)
        frame.reader(interface.REFERENCE, self._on_reference)
        frame.reader(interface.ESTIMATE, self._on_estimate)
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values["limited"] = lambda: self._limited

    def _make(self, parameters: Any) -> Controller:
        named = getattr(parameters, "model", "")
        model = load_table(named) if named else None
        return Controller(self._kind, parameters, self.frame.sample_time, model)

    def start(self) -> None:
        """Waits for the first reference and estimate."""

    def finish(self) -> None:
        """Nothing to put away."""

    def tick(self, stamp: int, steps: int) -> None:
        """Keeps no time of its own."""

    def _on_reference(self, stamp: int, *reference: float) -> None:
        self._reference, self._reference_stamp = reference, stamp
        if self.frame.lockstep and stamp == self._estimate_stamp:
            self._step(stamp)

    def _on_estimate(self, stamp: int, *estimate: float) -> None:
        self._estimate, self._estimate_stamp = estimate, stamp
        if self.frame.lockstep:
            if stamp == self._reference_stamp:
                self._step(stamp)
        elif self._reference_stamp >= 0:
            if stamp - self._reference_stamp > self._stale_after:
                self._reference = (self._reference[0], 0.0, 0.0)
            self._step(stamp)

    def _step(self, stamp: int) -> None:
        if self._live.changed:
            self._controller = self._make(self._live.take())
        self._state, u = self._controller.step(self._state, self._reference, self._estimate)
        self._writer.send(stamp, u)
        self._limited += abs(u) >= self._controller.parameters.limit
        diagnostics = self.frame.diagnostics
        diagnostics.cycles += 1
        if not self.frame.lockstep:
            diagnostics.latency(self.frame.now() - stamp)

    def _condition(self) -> tuple[int, str]:
        if self._reference_stamp < 0 or self._estimate_stamp < 0:
            missing = "reference" if self._reference_stamp < 0 else "estimate"
            return WARN, f"waiting for the first {missing}"
        return OK, f"{self._kind}: running"


def build(frame: Frame) -> ControllerNode:
    """The node in its frame."""
    return ControllerNode(frame)
