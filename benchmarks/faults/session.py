"""One run through faults for the campaign (campaign.py): play, inject, watch, recover, judge."""

from __future__ import annotations

import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message

from benchmarks.faults.cases import BRIDGE, WATCH, Case
from benchmarks.faults.links import NAMES, SIGNALS, Link, Operator, tail, target_action
from benchmarks.realtime.listener import Listener
from shake_ros.recordings.reference_file import load_reference, make_program
from shake_ros.ros.interface import DIAGNOSTICS, VALVE_COMMAND
from shake_ros.safety.causes import PROGRAM_HOLD, SEVERITY
from shake_ros.settings import config_folder

SHORT = {
    "synthetic_duration: 8.0": "synthetic_duration: 4.0",
    "pad_time: 1.5": "pad_time: 0.75",
    "change_time: 1.0": "change_time: 0.1",
}
SAMPLE_TIME = 1e-3
STARTING = 1.6  # from `enable` to the stage run at full span [s]
STOPPED = 0.5  # length of a SIGSTOP [s]
LEAD = 0.7  # before the fault the table must have followed for so long [s]
TOLERANCE = 0.010  # [m] of the reference's 38 mm
FOLLOWED = ("yes", "yes, 2nd")  # after the first or the second reset
TRAVEL = 0.005  # required [m]
STILL = 0.003  # a table slower than this has come to rest [m/s]
END_STOP = 0.130  # [m] of table bergamo
SECOND = 1_000_000_000
RESTARTING = 45.0  # timeout of a node that is started again [s]
RECENT = 200  # messages on /diagnostics that are looked at
BEFORE = 10_000_000  # of a fault, that is still looked at [ns]


@dataclass
class Row:
    """What came of a fault."""

    case: Case
    detected: float | None = None  # [s]
    trips: str = ""
    travel: float = 0.0
    whole: float = 0.0
    peak: float = 0.0
    farthest: float = 0.0
    rests: bool = False
    recovered: str = "?"

    def verdict(self) -> str:
        """Empty where all is as required, else what is not."""
        if self.case.note:
            return self.case.note
        wrong = []
        if self.detected is None and self.farthest > 0.0 and not self.ended_orderly():
            wrong.append("NOT DETECTED")
        if self.travel > TRAVEL:
            wrong.append("travels too far")
        if self.farthest >= END_STOP:
            wrong.append("END STOP")
        if self.detected is not None and not self.rests:
            wrong.append("does not rest")
        return ", ".join(wrong)

    def ended_orderly(self) -> bool:
        """Whether a node that was told to end has brought the table to rest itself, so that nothing had to trip."""
        return self.case.kind == "restart" and self.rests and self.whole <= TRAVEL

    def line(self) -> str:
        """The row of the table."""
        none = "orderly" if self.ended_orderly() else "-"
        detected = none if self.detected is None else f"{1e3 * self.detected:.0f}"
        return (
            f"{self.case.name:38}{detected:>8}  {self.trips:62}{1e3 * self.travel:7.1f}{1e3 * self.whole:7.1f}"
            f"{self.peak:7.1f}  {self.recovered:10} {self.verdict()}"
        )


HEAD = f"{'fault':38}{'ms':>8}  {'cause / action':62}{'mm':>7}{'whole':>7}{'m/s2':>7}  recovered"


def short_earthquake(folder: Path) -> tuple[str, float, float]:
    """Configuration of the earthquake that is played, its length [s] and when it is fastest [s]."""
    text = (config_folder() / "reference" / "earthquake.yaml").read_text()
    for old, new in SHORT.items():
        text = text.replace(old, new)
    path = folder / "short.yaml"
    path.write_text(text)
    program = make_program(load_reference(str(path)), SAMPLE_TIME)
    return str(path), program.length * SAMPLE_TIME, float(np.abs(program.states[:, 1]).argmax()) * SAMPLE_TIME


class Session:
    """One graph that runs through faults."""

    def __init__(self, link: Link, listener: Listener, operator: Operator, length: float, fastest: float) -> None:
        self.link = link
        self.listener = listener
        self.operator = operator
        self.length = length
        self.fastest = fastest
        self._scale = 1.0
        self._began = 0  # of the program [ns]
        self._ends = time.monotonic() + length
        self._second: Any = None
        self.why = ""  # that the table does not run

    def statuses(self, ending: str, since: int = 0, first: int = 0) -> list[dict[str, str]]:
        """Values on /diagnostics of statuses whose name ends so, from a place in the list on, with `time_ns` since."""
        found = []
        for data in self.listener.raw[DIAGNOSTICS.name][first:]:
            for status in deserialize_message(data, DIAGNOSTICS.type).status:
                values = {item.key: item.value for item in status.values}
                if status.name.endswith(ending) and int(values.get("time_ns", since)) >= since:
                    found.append({**values, "message": status.message, "node": status.name})
        return found

    def left(self) -> float:
        """Time until the program has ended [s]."""
        return self._ends - time.monotonic()

    def play(self) -> None:
        """The earthquake from its start, once the one before has ended."""
        time.sleep(max(0.0, self.left()))
        self._scale = 1.0 if self._scale != 1.0 else 0.9999
        self.operator.set_parameter("reference_generator", {"scale": self._scale})
        self._began = time.time_ns()
        self._ends = time.monotonic() + self.length + 0.2

    def recover(self) -> str:
        """Reset and enable at rest; empty where it was done, else why not."""
        time.sleep(max(0.0, self.left()))
        deadline = time.monotonic() + 15.0
        while True:
            done, why = self.operator.service("reset")
            if done:
                done, why = self.operator.service("enable", data=True)
            if done:
                time.sleep(STARTING)
                return ""
            if time.monotonic() > deadline:
                return why
            time.sleep(0.2)

    def follows(self) -> str:
        """Whether the table has followed until now: yes, or by how much not."""
        since = time.time_ns() - round(LEAD * SECOND)
        truth, reference = self.link.truth(self.listener, since), tail(self.listener, "reference", since)
        if len(truth) < 100 or len(reference) < 100:
            return f"no motion seen ({len(truth)}, {len(reference)})"
        wanted = np.interp(truth[:, 0], reference[:, 0], reference[:, 1])
        error = float(np.abs(truth[:, 1] - wanted).max())
        if error < TOLERANCE and np.ptp(truth[:, 1]) > 0.01:
            return FOLLOWED[0]
        last = len(self.listener.raw[DIAGNOSTICS.name]) - RECENT
        tripped = [one["cause"] for one in self.statuses(": interlock", since - 5 * SECOND, max(last, 0))]
        return f"{1e3 * error:.0f} mm off after {', '.join(tripped) or 'no trip'}"

    def inject(self, case: Case) -> int:
        """The fault comes; when [ns]."""
        now = time.time_ns()
        if case.kind in SIGNALS:
            self.link.process(case.what).send_signal(SIGNALS[case.kind])
            return now
        if case.kind == "service":
            self.operator.service(case.what)
            return now
        if case.kind == "second":
            topic = VALVE_COMMAND
            self._second = self.operator.node.create_publisher(topic.type, topic.name, topic.qos(False))
            return now
        place = len(self.listener.raw[DIAGNOSTICS.name])
        self.link.switch(self.operator, case, True)
        if case.kind == "machine" and self.link.kind == BRIDGE:
            rows = self.link.truth(self.listener, now)
            while not (on := rows[rows[:, 7] > 0]).size and time.time_ns() - now < SECOND:
                time.sleep(0.005)
                rows = self.link.truth(self.listener, now)
            return now + round(on[0, 0] * SECOND)
        deadline = time.monotonic() + 1.0
        while time.monotonic() < deadline:
            said = self.statuses(": fault", now, place)
            if any("time_ns" in one for one in said):
                return next(int(one["time_ns"]) for one in said if "time_ns" in one)
            time.sleep(0.005)
        return now

    def remove(self, case: Case) -> str:
        """The fault goes; what was killed is started again. Empty, or why that did not succeed."""
        if case.kind in ("machine", "message"):
            self.link.switch(self.operator, case, False)
        elif case.kind == "second":
            self.operator.node.destroy_publisher(self._second)
        elif case.kind in ("SIGKILL", "restart"):
            place = len(self.listener.raw[DIAGNOSTICS.name])
            self.link.start_again(case.what)
            deadline = time.monotonic() + RESTARTING
            while case.what != "target_emulator" and not self.statuses(f": {case.what}", first=place):
                if time.monotonic() > deadline:
                    return f"{case.what} is not heard"
                time.sleep(0.05)
            if case.what == "reference_generator":
                self._ends = time.monotonic() + self.length + 0.2
        return ""

    def trips(self, onset: int, place: int, truth: np.ndarray) -> list[tuple[float, str, str]]:
        """(time after the fault [s], cause, action) of what has acted since, each cause once, in order."""
        found = []
        for one in self.statuses(": interlock", onset - 2_000_000, place):
            found.append(((int(one["time_ns"]) - onset) * 1e-9, one["cause"], one["action"]))
        if self.link.kind == BRIDGE:
            for number in {int(n) for n in truth[:, 6] if n}:
                at = float(truth[truth[:, 6] == number][0, 0])
                found.append((at, f"target {NAMES[number]}", target_action(NAMES[number])))
        return sorted(one for one in found if SEVERITY[one[2]] >= SEVERITY[PROGRAM_HOLD])

    def lead(self) -> str:
        """The earthquake until it is fastest: whether the table follows, at the second attempt if not at the first."""
        for word in FOLLOWED:
            if self.why:
                return self.why
            self.play()
            time.sleep(max(0.0, self.fastest - 0.01 - (time.time_ns() - self._began) * 1e-9))
            followed = self.follows()
            if followed == FOLLOWED[0]:
                return word
            self.why = self.recover()
        return followed

    def run(self, case: Case) -> Row:
        """One fault at the end of a lead, and what came of it."""
        row = Row(case, recovered="")
        place = len(self.listener.raw[DIAGNOSTICS.name])
        onset = self.inject(case)
        if case.kind == "SIGSTOP":
            time.sleep(STOPPED)
            self.link.process(case.what).send_signal(signal.SIGCONT)
        time.sleep(max(0.0, WATCH - (time.time_ns() - onset) * 1e-9))
        truth = self.link.truth(self.listener, onset - BEFORE)
        truth[:, 0] -= BEFORE / SECOND
        self.judge(row, self.trips(onset, place, truth), truth)
        self.why = self.remove(case) or self.recover()
        return row

    def judge(self, row: Row, trips: list[tuple[float, str, str]], truth: np.ndarray) -> None:
        """Figures of one fault."""
        if trips:
            row.detected = max(0.0, trips[0][0])
            hardest = max(trips, key=lambda one: SEVERITY[one[2]])
            named = [trips[0]] + ([hardest] if SEVERITY[hardest[2]] > SEVERITY[trips[0][2]] else [])
            row.trips = ", ".join(f"{cause}/{action}" for _, cause, action in named)
        if not len(truth) or (row.case.note and row.case.what in ("plant", "target_emulator")):
            return
        t, x, v = truth[:, 0], truth[:, 1], truth[:, 2]
        after = t >= 0.0
        if t[0] > 0.0 or not after.any():
            return
        row.peak, row.farthest = float(np.abs(truth[after, 3]).max()), float(np.abs(x[after]).max())
        row.whole = farthest_from(truth, 0.0)
        if row.detected is not None:
            row.travel = farthest_from(truth, row.detected)
        row.rests = bool(np.abs(v[-50:]).max() < STILL)


def farthest_from(truth: np.ndarray, time: float) -> float:
    """How far the table goes from where it is at a time [m]; over a pause of the plant on with its last speed."""
    t, x, v = truth[:, 0], truth[:, 1], truth[:, 2]
    last = max(int(np.searchsorted(t, time, side="right")) - 1, 0)
    there = x[last] + v[last] * (time - t[last])
    return float(np.abs(x[last + 1 :] - there).max()) if last + 1 < len(x) else 0.0
