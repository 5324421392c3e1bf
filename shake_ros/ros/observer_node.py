"""Node `observer`: position, other sensors where it takes them, valve command → position, velocity, acceleration.

The parameter `observer` and those of the observer in use may change while it runs: another observer continues from the
last estimate, the same one from its own state.

The other sensors' samples are taken by their stamps; a sensor that is lost is left out until it is back.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.law import SENSORS
from shake_ros.control.observer.runner import Observer
from shake_ros.quantities import Parameters, choice
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Behaviour, Frame, Reader
from shake_ros.ros.parameters import LiveLaw, Sets, variants
from shake_ros.settings import load_table

TOPICS = dict(zip(SENSORS, (interface.IMU, interface.PRESSURE_A, interface.PRESSURE_B), strict=True))
MISSED = 5  # samples in a row without which a sensor is lost in real time
SILENT = 1.0  # [s] of the wall clock that lock-step waits for a sensor before it is lost


class OtherSensors:
    """The newest sample of each sensor that is wanted, and whether it is there.

    Lock-step waits for a sensor's sample until that has been silent for SILENT; real time for as long as no newer
    position comes, and after MISSED samples no more. A sensor that is lost is taken again when it speaks again.

    Parameters
    ----------
    notify : called whenever a sample has come.
    """

    def __init__(self, frame: Frame, notify: Callable[[], None]) -> None:
        self._frame, self._notify = frame, notify
        self._stamps: dict[str, int] = {}
        self._values: dict[str, float] = {}
        self._missed: dict[str, int] = {}
        self._read: set[str] = set()
        self._waiting: tuple[int, float] = -1, 0.0  # sample, and since when it is waited for [s]
        self._wanted: Sequence[str] = ()
        self._left_out: tuple[str, ...] = ()

    def want(self, names: Sequence[str]) -> None:
        """The sensors to take from now on."""
        self._wanted = names
        for name in names:
            if name in self._read:
                continue
            self._read.add(name)
            self._stamps[name], self._values[name] = -1, math.nan
            self._missed[name] = 0 if self._frame.lockstep else MISSED
            take = functools.partial(self._on_sample, name)
            Reader(self._frame, TOPICS[name], take, functools.partial(self._on_refused, name))

    @property
    def lost(self) -> list[str]:
        """Wanted sensors that are not there, by their topics."""
        return [TOPICS[name].name for name in self._wanted if self._missed[name] >= MISSED]

    def _on_sample(self, name: str, stamp: int, value: float) -> None:
        if self._missed[name] >= MISSED and self._stamps[name] >= 0:
            self._frame.say(OK, f"observer: {TOPICS[name].name} is back")
        self._stamps[name], self._values[name], self._missed[name] = stamp, value, 0
        self._notify()

    def _on_refused(self, name: str, stamp: int, _reason: str) -> None:
        """A sample that is no number: there is none for its instant."""
        if stamp > self._stamps[name]:
            self._stamps[name], self._values[name] = stamp, math.nan
            self._count(name, MISSED if self._frame.lockstep else 1)
            self._notify()

    def complete(self, stamp: int) -> bool:
        """Whether every sensor that is there has its sample of this instant [ns], or a newer one."""
        return all(self._missed[name] >= MISSED or self._stamps[name] >= stamp for name in self._wanted)

    def readings(self, stamp: int) -> list[float]:
        """Acceleration, P_A, P_B of an instant [ns], NaN where there is none."""
        found = []
        for name in SENSORS:
            there = name in self._wanted and self._stamps[name] == stamp
            found.append(self._values[name] if there else math.nan)
        return found

    def give_up(self, stamp: int) -> None:
        """Real time: count who has missed a sample."""
        for name in self._wanted:
            if self._stamps[name] < stamp:
                self._count(name, 1)

    def silent_too_long(self, stamp: int) -> bool:
        """Lock-step: whether who is silent at this sample is lost from now on."""
        if self._waiting[0] != stamp:
            self._waiting = stamp, time.monotonic()
        if time.monotonic() - self._waiting[1] < SILENT:
            return False
        for name in self._wanted:
            if self._stamps[name] < stamp:
                self._count(name, MISSED)
        return True

    def _count(self, name: str, samples: int) -> None:
        before = self._missed[name]
        self._missed[name] = before + samples
        if before < MISSED <= self._missed[name]:
            self._frame.say(WARN, f"observer: {TOPICS[name].name} is lost, the estimate continues without it")

    def leave_out(self, names: tuple[str, ...]) -> None:
        """Report which sensors the observer does not believe, when that changes."""
        if names != self._left_out:
            for name in set(names) - set(self._left_out):
                self._frame.say(WARN, f"observer: {name} is implausible or frozen, left out")
            for name in set(self._left_out) - set(names):
                self._frame.say(OK, f"observer: {name} is used again")
            self._left_out = names

    def text(self) -> str:
        """What is taken, lost or not believed, for /diagnostics; empty without sensors."""
        lost = self.lost
        taken = [TOPICS[name].name for name in self._wanted if TOPICS[name].name not in (*lost, *self._left_out)]
        parts = [f", with {' '.join(taken)}"] if taken else []
        parts += [f", without {' '.join([*lost, *self._left_out])}"] if lost or self._left_out else []
        return "".join(parts)

    @property
    def sound(self) -> bool:
        """Whether all that is wanted is taken."""
        return not (self.lost or self._left_out)


LOOK = 0.25  # [s] between looks at which sensor is silent


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
        self._law = LiveLaw(frame.parameters, "observer", own, variants("observer", OBSERVERS), self._make, live=True)
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
        Reader(frame, interface.JOINT_STATES, self._on_measured)
        Reader(frame, interface.VALVE_COMMAND, self._on_command)
        frame.diagnostics.condition = self._condition
        if frame.lockstep:
            frame.every(LOOK, self._look_for_silence)

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

    def _look_for_silence(self) -> None:
        """Lock-step: go on without a sensor that stays silent."""
        if self._waiting is not None and self._commanded() and self._others.silent_too_long(self._waiting[0]):
            self._step_when_complete()

    def _step(self, stamp: int, position: float) -> None:
        if self._law.changed:
            self._observer, renamed = self._law.take()
            self._writer.codec.lead = round(self._observer.lead * SECOND)
            self._others.want(self._observer.parameters.sensors)
            if self._state is not None:
                fresh = self._observer.started(self._estimate, self._u)
                self._state = fresh if renamed or len(fresh) != len(self._state) else self._state
        if self._state is None:
            self._state = self._observer.initial_state(position)
        others = self._others.readings(stamp)
        self._state, self._estimate = self._observer.step(self._state, position, self._u, others)
        self._others.leave_out(self._observer.parameters.not_believed(self._state))
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
