"""Node `twin`: a found table followed beside the running one; its prediction, parameters and changes as messages.

Callbacks only put samples together; one thread follows them (shake_ros/twin), so that a window that takes long delays
no sample. On the operator's `release` the followed values go to observer and controller (release.py). The same samples
give the same numbers as `follow` over the recording. It ends when nobody publishes positions any more, once it has
followed all that came.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND, time_message
from shake_ros.ros.diagnostics import ERROR, OK, WARN, Input, status_of
from shake_ros.ros.frame import Behaviour, Frame, Reader
from shake_ros.ros.interface import REALTIME_RECORDER_QOS, copied
from shake_ros.settings import find, load_table

if TYPE_CHECKING:
    from shake_ros.ros.release import Releasing
    from shake_ros.twin.twin import Change, TwinWindow

INPUTS = (interface.VALVE_COMMAND, interface.JOINT_STATES, interface.IMU)
BATCH = 0.1  # samples that are handed over at once [s]
LOOK = 0.25  # between two looks at who is silent [s]
SILENT = 1.0  # of a topic, from which the twin says that it pauses [s]
PORTION, REST = 200, 0.02  # samples of a prediction that are published at once; pause behind them [s]
WAITING = 4096  # samples that wait for the rest of their instant
WORDS = {  # state → words
    "waiting": "waiting for samples",
    "learning": "learning what is normal",
    "watching": "nothing has changed",
    "naming": "something changed; more motion will show what",
}


@dataclass(frozen=True)
class TwinNodeParameters(Parameters):
    """The node's settings."""

    table: str = choice("found table: its YAML file, or a name of config/table")
    settings: str = choice("configuration in config/twin, or a YAML file")
    backlog: float = quantity("s", "samples that may wait for the twin", low=1.0, high=3600.0)
    release: bool = choice("whether followed values go to observer and controller", live=True)
    release_factor: float = quantity("-", "by which a released value may leave the file's", low=1.0, high=10.0)
    release_time: float = quantity("s", "time constant with which the loop takes it", low=0.1, high=1e3)


class Instants:
    """Puts the samples of the topics together by their stamps, in order; an instant that lacks one is left out."""

    def __init__(self) -> None:
        self._newest = [-1] * len(INPUTS)
        self._waiting: dict[int, list[float]] = {}

    def add(self, place: int, stamp: int, value: float) -> list[tuple[int, list[float]]]:
        """The instants that a sample of a topic completes, as stamp and values of all topics."""
        self._newest[place] = stamp
        self._waiting.setdefault(stamp, [math.nan] * len(INPUTS))[place] = value
        over = min(self._newest) if len(self._waiting) < WAITING else max(self._newest)
        ready = sorted(s for s in self._waiting if s <= over)
        whole = [(s, self._waiting.pop(s)) for s in ready]
        return [(s, values) for s, values in whole if all(map(math.isfinite, values))]


class TwinNode(Behaviour):
    """Samples to the following thread; what it finds to the topics."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self._own = frame.settings(TwinNodeParameters)
        own = self._own.value
        self._most = round(own.backlog / frame.sample_time)
        self._instants, self._ready = Instants(), list[tuple[int, list[float]]]()
        self._queue, self._there = deque[list[tuple[int, list[float]]]](), threading.Condition()
        self._queued = self._dropped = 0
        self._over, self._ended, self._error = False, False, ""
        self._state, self._note, self._changes = "waiting", "", list[tuple[int, str, dict[str, object]]]()
        self._last: TwinWindow | None = None
        self._newest, self._releasing = 0, cast("Releasing | None", None)
        self._publisher = frame.publisher(interface.TWIN)
        self._predicted = frame.writer(interface.PREDICTED_JOINT_STATES), frame.writer(interface.PREDICTED_IMU)
        profile = None if frame.lockstep else copied(REALTIME_RECORDER_QOS)  # takes all, however late
        readers = [Reader(frame, t, self._taker(i), profile=profile) for i, t in enumerate(INPUTS)]
        self._inputs = [r.input for r in readers]
        self._silent = dict.fromkeys((t.name for t in INPUTS), False)
        frame.diagnostics.condition = lambda: self._light(self._pause())
        frame.diagnostics.values["state"] = lambda: "paused" if self._pause() else self._state
        frame.diagnostics.values["waiting_samples"] = lambda: self._queued
        frame.diagnostics.values["dropped_samples"] = lambda: self._dropped
        frame.every(LOOK, self._look)
        if not own.table:
            raise ShakeError("parameter table: the found table is needed")
        self._table, self._settings = load_table(own.table), str(find("twin", own.settings))
        self._thread = threading.Thread(target=self._follow, name="following", daemon=True)

    def start(self) -> None:
        """Begin to follow."""
        self._thread.start()

    def finish(self) -> None:
        """Follow what has come to its end where the table has ended; drop what waits where the node is stopped."""
        if not self._ended:
            self._most = 0
        self._hand_over(over=True)
        if self._thread.ident is not None:
            self._thread.join()
        if self._error:
            raise ShakeError(self._error)

    def _taker(self, place: int) -> Callable[[int, float], None]:
        def take(stamp: int, value: float) -> None:
            self._ready += self._instants.add(place, stamp, value)
            self._newest = stamp
            if len(self._ready) >= BATCH / self.frame.sample_time:
                self._hand_over()
            self.frame.diagnostics.cycles += place == 1

        return take

    def _hand_over(self, over: bool = False) -> None:
        """Give what is ready to the thread; where too much waits, the oldest is dropped."""
        with self._there:
            self._queue.append(self._ready)
            self._queued, self._ready, self._over = self._queued + len(self._ready), [], self._over or over
            while self._queued > self._most and not (self.frame.lockstep and self._most):
                gone = len(self._queue.popleft())
                self._queued, self._dropped = self._queued - gone, self._dropped + gone
            self._there.notify()

    def _stopped(self, item: Input) -> bool:
        """Whether a topic came, and comes no more; in lock-step, which may be slow, only once nobody publishes it."""
        if item.last_arrival < 0 or item.age() <= SILENT:
            return False
        return not (self.frame.lockstep and self.frame.node.count_publishers(self.frame.resolved(item.name)))

    def _look(self) -> None:
        """Say which topic has stopped or is back; end where nobody publishes positions any more."""
        position = self._inputs[1]
        here = self.frame.node.count_publishers(self.frame.resolved(interface.JOINT_STATES.name))
        if position.last_arrival >= 0 and not here:
            if position.age() > SILENT:
                self._ended = True
                self.frame.stop()
            return
        for item in self._inputs:
            silent = self._stopped(item)
            if silent != self._silent[item.name]:
                self._silent[item.name] = silent
                self.frame.say(*((WARN, paused(nothing_on(item.name))) if silent else (OK, f"{item.name} is back")))

    def _follow(self) -> None:
        try:
            self._make()
            while True:
                with self._there:
                    self._there.wait_for(lambda: self._queue or self._over)
                    if not self._queue:
                        break
                    samples = self._queue.popleft()
                    self._queued -= len(samples)
                if samples:
                    values = np.array([v for _, v in samples]).T
                    for window in self.twin.add(np.array([s for s, _ in samples], dtype=np.int64), *values):
                        self._publish(window)
            if (last := self.twin.finish()) is not None and self._last is not None:
                self._changed(last)
                self._send(replace(self._last, state="watching"))
        except ShakeError as error:
            self._error = str(error)
            self.frame.diagnostics.fault("twin", str(error))
        finally:
            if self._releasing is not None:
                self._releasing.end()
            if not self._over:
                self.frame.stop()

    def _make(self) -> None:
        """The twin and what serves the parameter `release`; they take seconds to import, in which samples wait."""
        from shake_ros.ros.release import Releasing
        from shake_ros.twin.followed import load_twin
        from shake_ros.twin.release import Release
        from shake_ros.twin.twin import Twin

        own = self._own.value
        self.twin = Twin(self._table, load_twin(self._settings), self.frame.sample_time)
        release = Release(self.twin, own.release_factor, own.release_time)
        self._releasing = Releasing(
            self.frame, lambda: self._own.value.release, release, self._table, lambda: self._newest
        )

    def _publish(self, window: TwinWindow) -> None:
        """One window: its line where it pauses or goes on, its status, its prediction."""
        if window.note != self._note:
            self._note = window.note
            self.frame.say(*((WARN, paused(window.note)) if window.note else (OK, "going on")))
        if window.change is not None:
            self._changed(window.change)
        self._send(window)
        if self._releasing is not None:
            self._releasing.know(window, not any(level == ERROR for level, *_ in self._changes))
        count = len(window.motion)
        stamps = window.start + np.rint(np.arange(count) * self.frame.sample_time * SECOND).astype(np.int64)
        for k in range(count):
            stamp, (position, _, acceleration, *_) = int(stamps[k]), window.motion[k].tolist()
            self._predicted[0].send(stamp, position)
            self._predicted[1].send(stamp, acceleration)
            if k % PORTION == PORTION - 1 and not self.frame.lockstep:
                time.sleep(REST)

    def _changed(self, change: Change) -> None:
        """A change: a line, and the light that stays."""
        from shake_ros.twin.page import action_text, asks_for_action, change_text, error_text, rivals_text, what_text

        named, words = change.named, change_text(change)
        level = ERROR if asks_for_action(change) else WARN
        values = {"since": change.since, "verdict": named.verdict, "place": named.place}
        values |= {"change": what_text(change), "rivals": rivals_text(change)}
        values |= {"error": error_text(change), "action": action_text(change)}
        others = [c for c in self._changes if c[2]["since"] != change.since]  # one that goes on is named again
        self._changes = [*others, (level, words, values)]
        self.frame.say(level, words)

    def _pause(self) -> str:
        """Why the twin pauses now; empty where it does not."""
        silent = ", ".join(item.name for item in self._inputs if self._stopped(item))
        return nothing_on(silent) if silent else self._note

    def _light(self, pause: str) -> tuple[int, str]:
        """Level and words of what has been found, and of what the twin is doing. pause : why it does nothing."""
        state = self._state
        level = max([WARN if pause or state == "naming" else OK, *(level for level, *_ in self._changes)])
        words = [paused(pause)] * bool(pause) + [text for _, text, _ in self._changes[-1:]]
        return level, "; ".join(words if words and state != "naming" else [*words, WORDS.get(state, state)])

    def _send(self, window: TwinWindow) -> None:
        """Publish the status of a window."""
        self._last, self._state = window, window.state
        values = {"state": window.state, "note": window.note, "mean_square": window.square}
        rows = zip(self.twin.names, self.twin.units, window.values, *window.ends, strict=True)
        message = DiagnosticArray(
            status=[self._status("table", *self._light(window.note), values)]
            + [self._parameter(name, unit, *map(float, numbers)) for name, unit, *numbers in rows]
            + [self._status(f"change {number}", *change) for number, change in enumerate(self._changes, 1)]
        )
        message.header.stamp = time_message(window.stamp)
        self._publisher.publish(message)

    def _parameter(self, name: str, unit: str, value: float, low: float, high: float) -> DiagnosticStatus:
        from shake_ros.report.text import interval_text

        values = {"value": value, "low": low, "high": high, "unit": unit}
        return self._status(name, OK, interval_text(value, 0.5 * (high - low), unit), values)

    def _status(self, name: str, level: int, text: str, values: Mapping[str, object]) -> DiagnosticStatus:
        hardware = self.frame.node.get_fully_qualified_name().lstrip("/")
        return status_of(f"twin {name}", hardware, level, text, values)


def nothing_on(topics: str) -> str:
    """Why the twin pauses where topics have stopped."""
    return f"nothing on {topics} for {SILENT:g} s"


def paused(why: str) -> str:
    """That the twin pauses."""
    return f"paused: {why}"


build = TwinNode
