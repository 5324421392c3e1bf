"""Node `observer`: position, other sensors where it takes them, valve command → position, velocity, acceleration.

The parameter `observer` and those of the observer in use may change while it runs: what comes of it continues from the
last estimate.
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
from shake_ros.ros.frame import Behaviour, Frame
from shake_ros.ros.live_law import LiveLaw, Sets, variants
from shake_ros.ros.other_sensors import OtherSensors
from shake_ros.settings import load_table

PATIENCE = 0.25  # [s] between looks at who is silent


@dataclass(frozen=True)
class ObserverNodeParameters(Parameters):
    """The node's own settings; those of the observer come from its configuration."""

    observer: str = choice("configuration in config/observer, or a YAML file", live=True)


class ObserverNode(Behaviour):
    """Estimate k from measurement k and command k − 1; lock-step waits for both, real time takes the newest.

    An observer that takes accelerometer and pressures gets those of measurement k; without one it goes on and says so.
    """

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        own = frame.settings(ObserverNodeParameters)
        self._law = LiveLaw(frame, "observer", own, variants("observer", OBSERVERS), self._make, live=True)
        self._observer = self._law.take()[0]
        self._state: Any = None
        self._estimate: Any = None
        self._waiting: tuple[int, float] | None = None
        self._last_stamp = -1
        self._u = 0.0
        self._u_stamp = -1
        self._writer = frame.writer(interface.ESTIMATE)
        self._writer.codec.lead = round(self._observer.lead * SECOND)
        self._others = OtherSensors(frame, self._step_when_complete)
        self._others.want(self._observer.parameters.sensors)
        frame.reader(interface.JOINT_STATES, self._on_measured)
        frame.reader(interface.VALVE_COMMAND, self._on_command)
        frame.diagnostics.condition = self._condition
        if frame.lockstep:
            frame.every(PATIENCE, self._be_patient)

    def _make(self, kind: str, sets: Sets) -> Observer:
        """An observer that has been compiled, so that its first sample is not late."""
        named = getattr(sets[""], "model", "")
        observer = Observer(kind, sets[""], self.frame.sample_time, load_table(named) if named else None)
        observer.step(observer.initial_state(0.0), 0.0, 0.0)
        return observer

    def _on_measured(self, stamp: int, position: float) -> None:
        if self._waiting is not None and not self.frame.lockstep:  # a sensor has said nothing for a whole sample
            waiting, self._waiting = self._waiting, None
            self._others.give_up(waiting[0])
            self._step(*waiting)
        self._waiting = stamp, position
        self._step_when_complete()

    def _on_command(self, stamp: int, u: float) -> None:
        self._u, self._u_stamp = u, stamp
        self._step_when_complete()

    def _commanded(self) -> bool:
        """Whether the command of the sample before has come, which lock-step needs."""
        return not self.frame.lockstep or self._last_stamp < 0 or self._u_stamp >= self._last_stamp

    def _step_when_complete(self) -> None:
        if self._waiting is not None and self._commanded() and self._others.complete(self._waiting[0]):
            waiting, self._waiting = self._waiting, None
            self._step(*waiting)

    def _be_patient(self) -> None:
        """Lock-step: go on without a sensor that stays silent."""
        if self._waiting is not None and self._commanded() and self._others.patience(self._waiting[0]):
            self._step_when_complete()

    def _step(self, stamp: int, position: float) -> None:
        if self._law.changed:
            self._observer = self._law.take()[0]
            self._writer.codec.lead = round(self._observer.lead * SECOND)
            self._others.want(self._observer.parameters.sensors)
            if self._state is not None:
                self._state = self._observer.started(self._estimate, self._u)
        if self._state is None:
            self._state = self._observer.initial_state(position)
        others = self._others.readings(stamp)
        self._state, self._estimate = self._observer.step(self._state, position, self._u, others)
        self._others.doubt(self._observer.parameters.not_believed(self._state))
        self._last_stamp = stamp
        self._writer.send(stamp, *self._estimate.tolist())
        diagnostics = self.frame.diagnostics
        diagnostics.cycles += 1
        if not self.frame.lockstep:
            diagnostics.latency(self.frame.now() - stamp)
        self.frame.pause.begins()

    def _condition(self) -> tuple[int, str]:
        if self._last_stamp < 0:
            return WARN, "waiting for the first measurement"
        ahead = f", {1e3 * self._observer.lead:.3g} ms ahead" if self._observer.lead > 0.0 else ""
        late = (self._last_stamp - self._u_stamp) / SECOND
        sensors = self._others.text()
        level = OK if self._others.sound else WARN
        return level, f"{self._observer.kind}: running{sensors}{ahead}, command of {late:.3f} s ago"


build = ObserverNode
