"""What an observer takes beside the position: the other sensors' samples, by their stamps; who is lost, and back."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Sequence

from shake_ros.core.observer.law import SENSORS
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Frame

TOPICS = dict(zip(SENSORS, (interface.IMU, interface.PRESSURE_A, interface.PRESSURE_B), strict=True))
MISSED = 5  # samples in a row without which a sensor is lost in real time
SILENT = 1.0  # [s] of the wall clock that lock-step waits for a sensor before it is lost


class OtherSensors:
    """The newest sample of each sensor that is wanted, and whether it is there.

    Lock-step waits for a sensor's sample until that has been silent for SILENT; real time for as long as no newer
    position comes, and after MISSED samples no more. A sensor that is lost is taken again when it speaks again.

    Parameters
    ----------
    heard : called whenever a sample has come.
    """

    def __init__(self, frame: Frame, heard: Callable[[], None]) -> None:
        self._frame, self._heard = frame, heard
        self._stamps: dict[str, int] = {}
        self._values: dict[str, float] = {}
        self._missed: dict[str, int] = {}
        self._read: set[str] = set()
        self._waiting: tuple[int, float] = -1, 0.0  # sample, and since when it is waited for [s]
        self._wanted: Sequence[str] = ()
        self._doubted: tuple[str, ...] = ()

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
            self._frame.reader(TOPICS[name], take, functools.partial(self._on_refused, name))

    @property
    def lost(self) -> list[str]:
        """Wanted sensors that are not there, by their topics."""
        return [TOPICS[name].name for name in self._wanted if self._missed[name] >= MISSED]

    def _on_sample(self, name: str, stamp: int, value: float) -> None:
        if self._missed[name] >= MISSED and self._stamps[name] >= 0:
            self._frame.say(OK, f"observer: {TOPICS[name].name} is there again")
        self._stamps[name], self._values[name], self._missed[name] = stamp, value, 0
        self._heard()

    def _on_refused(self, name: str, stamp: int, _reason: str) -> None:
        """A sample that is no number: there is none for its instant."""
        if stamp > self._stamps[name]:
            self._stamps[name], self._values[name] = stamp, math.nan
            self._count(name, MISSED if self._frame.lockstep else 1)
            self._heard()

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

    def patience(self, stamp: int) -> bool:
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
            self._frame.say(WARN, f"observer: {TOPICS[name].name} is lost, the estimate goes on without it")

    def doubt(self, names: tuple[str, ...]) -> None:
        """Say which sensors the observer does not believe, when that changes."""
        if names != self._doubted:
            for name in set(names) - set(self._doubted):
                self._frame.say(WARN, f"observer: {name} is far off what is expected or frozen, not taken")
            for name in set(self._doubted) - set(names):
                self._frame.say(OK, f"observer: {name} is believed again")
            self._doubted = names

    def text(self) -> str:
        """What is taken, lost or not believed, for /diagnostics; empty without sensors."""
        lost = self.lost
        taken = [TOPICS[name].name for name in self._wanted if TOPICS[name].name not in (*lost, *self._doubted)]
        parts = [f", with {' '.join(taken)}"] if taken else []
        parts += [f", without {' '.join([*lost, *self._doubted])}"] if lost or self._doubted else []
        return "".join(parts)

    @property
    def sound(self) -> bool:
        """Whether all that is wanted is taken."""
        return not (self.lost or self._doubted)
