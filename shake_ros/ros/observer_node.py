"""Node `observer`: position and valve command → estimate of position, velocity and acceleration.

The parameter `observer` may change while it runs: the new observer continues from the last estimate. Its gains come
from its own configuration; the parameters that the node shows besides are those of the observer that it started with.
"""

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

    observer: str = choice("configuration in config/observer, or a YAML file", live=True)


class ObserverNode:
    """Estimate k from measurement k and command k − 1; lock-step waits for both, real time takes the newest."""

    ticks = False

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        settings = ObserverNodeParameters.from_mapping(node_settings("observer"), "config/node/observer.yaml")
        self._observer: Any = None
        self._own = frame.parameters.declare(settings, accept=self._accept)
        kind, configured = load_variant("observer", self._own.take().observer, OBSERVERS)
        self._observer = self._make(
            kind, frame.parameters.declare(configured, accept=lambda p: self._make(kind, p)).value
        )
        self._next = self._observer
        self._state: Any = None
        self._estimate: Any = None
        self._waiting: tuple[int, float] | None = None
        self._last_stamp = -1
        self._u = 0.0
        self._u_stamp = -1
        self._writer = frame.writer(interface.ESTIMATE)
        frame.reader(interface.JOINT_STATES, self._on_measured)
        frame.reader(interface.VALVE_COMMAND, self._on_command)
        frame.diagnostics.condition = self._condition

    def _make(self, kind: str, parameters: Any) -> Observer:
        """An observer that has been compiled, so that its first sample is not late."""
        named = getattr(parameters, "model", "")
        model = load_table(named) if named else None
        observer = Observer(kind, parameters, self.frame.sample_time, model)
        observer.step(observer.initial_state(0.0), 0.0, 0.0)
        return observer

    def _accept(self, settings: ObserverNodeParameters) -> None:
        """Get the named observer ready while the present one still runs; at the start the constructor does it."""
        if self._observer is not None:
            self._next = self._make(*load_variant("observer", settings.observer, OBSERVERS))

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

    def _switch(self) -> None:
        """Put the newly named observer in the place of the present one, at its last estimate."""
        self._own.take()
        self._observer = self._next
        if self._state is not None:
            self._state = self._observer.started(self._estimate, self._u)

    def _step(self, stamp: int, position: float) -> None:
        if self._own.changed:
            self._switch()
        if self._state is None:
            self._state = self._observer.initial_state(position)
        self._state, self._estimate = self._observer.step(self._state, position, self._u)
        self._last_stamp = stamp
        self._writer.send(stamp, *self._estimate.tolist())
        diagnostics = self.frame.diagnostics
        diagnostics.cycles += 1
        if not self.frame.lockstep:
            diagnostics.latency(self.frame.now() - stamp)

    def _condition(self) -> tuple[int, str]:
        if self._last_stamp < 0:
            return WARN, "waiting for the first measurement"
        return OK, f"{self._observer.kind}: running, command of {(self._last_stamp - self._u_stamp) / SECOND:.3f} s ago"


def build(frame: Frame) -> ObserverNode:
    """The node in its frame."""
    return ObserverNode(frame)
