"""Node `observer`: position and valve command → estimate of position, velocity and acceleration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from shake_ros.core.observer import OBSERVERS
from shake_ros.core.observer.runner import Observer
from shake_ros.core.quantities import Parameters, choice
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Frame, node_settings
from shake_ros.settings import load_table, load_variant


@dataclass(frozen=True)
class ObserverNodeParameters(Parameters):
    """The node's own settings; those of the observer come from its configuration."""

    observer: str = choice("configuration in config/observer, or a YAML file")


class ObserverNode:
    """Estimate k from measurement k and command k − 1; lock-step waits for both, real time takes the newest."""

    ticks = False

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        settings = ObserverNodeParameters.from_mapping(node_settings("observer"), "config/node/observer.yaml")
        own = frame.parameters.declare(settings).value
        self._kind, configured = load_variant("observer", own.observer, OBSERVERS)
        self._live = frame.parameters.declare(configured, accept=self._make)
        self._observer = self._make(self._live.take())
        self._observer.step(self._observer.initial_state(0.0), 0.0, 0.0)  # compiles before the first sample
        self._state: Any = None
        self._waiting: tuple[int, float] | None = None
        self._last_stamp = -1
        self._u = 0.0
        self._u_stamp = -1
        self._writer = frame.writer(interface.ESTIMATE)
        frame.reader(interface.JOINT_STATES, self._on_measured)
        frame.reader(interface.VALVE_COMMAND, self._on_command)
        frame.diagnostics.condition = self._condition

    def _make(self, parameters: Any) -> Observer:
        named = getattr(parameters, "model", "")
        model = load_table(named) if named else None
        return Observer(self._kind, parameters, self.frame.sample_time, model)

    def start(self) -> None:
        """Waits for the first measurement."""

    def finish(self) -> None:
        """Nothing to put away."""

    def tick(self, stamp: int, steps: int) -> None:
        """Keeps no time of its own."""

    def _on_measured(self, stamp: int, position: float) -> None:
        if not self.frame.lockstep or self._last_stamp < 0 or self._u_stamp >= self._last_stamp:
            self._step(stamp, position)
        else:
            self._waiting = stamp, position

    def _on_command(self, stamp: int, u: float) -> None:
        self._u, self._u_stamp = u, stamp
        if self._waiting is not None and stamp >= self._last_stamp:
            waiting, self._waiting = self._waiting, None
            self._step(*waiting)

    def _step(self, stamp: int, position: float) -> None:
        if self._live.changed:
            self._observer = self._make(self._live.take())
        if self._state is None:
            self._state = self._observer.initial_state(position)
        self._state, estimate = self._observer.step(self._state, position, self._u)
        self._last_stamp = stamp
        self._writer.send(stamp, *estimate.tolist())
        diagnostics = self.frame.diagnostics
        diagnostics.cycles += 1
        if not self.frame.lockstep:
            diagnostics.latency(self.frame.now() - stamp)

    def _condition(self) -> tuple[int, str]:
        if self._last_stamp < 0:
            return WARN, "waiting for the first measurement"
        return OK, f"{self._kind}: running, command of {(self._last_stamp - self._u_stamp) / SECOND:.3f} s ago"


def build(frame: Frame) -> ObserverNode:
    """The node in its frame."""
    return ObserverNode(frame)
