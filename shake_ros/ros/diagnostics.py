"""/diagnostics of every node at 1 Hz: rate, latency, missed deadlines, stale inputs, losses, limits, state.

A node says at its end what its timing was over a whole run in real time: jitter of the period, latencies.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.publisher import Publisher

from shake_ros.realtime import Durations

LEVELS = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)
OK, WARN, ERROR = range(3)
NO_ANSWER = "no answer from the target"  # begins what a bridge says while its target computer is silent
WINDOW = 8192  # latencies kept between two reports, the newest
STALE = 1.0  # an input silent for longer than one report [s] is named
MICROSECOND = 1e-3  # of a nanosecond count


class Input:
    """What came in on one topic: how many, which were lost, doubled, refused, or of other joints.

    Parameters
    ----------
    period : nominal distance of two stamps [ns].
    """

    def __init__(self, name: str, period: int) -> None:
        self.name = name
        self.period = period
        self.received = 0
        self.lost = 0
        self.doubled = 0
        self.refused = 0
        self.others = 0
        self.last_stamp = -1
        self.last_arrival = -1

    def count(self, stamp: int) -> bool:
        """Count a message by its stamp [ns]; False where this instant has already been seen."""
        if stamp <= self.last_stamp:
            self.doubled += 1
            return False
        if self.last_stamp >= 0:
            self.lost += max(0, round((stamp - self.last_stamp) / self.period) - 1)
        self.received += 1
        self.last_stamp = stamp
        self.last_arrival = time.monotonic_ns()
        return True

    def age(self) -> float:
        """Time since the last message [s]; infinite before the first."""
        if self.last_arrival < 0:
            return float("inf")
        return (time.monotonic_ns() - self.last_arrival) * 1e-9


def status_of(name: str, hardware: str, level: int, text: str, values: Mapping[str, object]) -> DiagnosticStatus:
    """The status of what has a name in the node `hardware`: text for a person, values for a program."""
    return DiagnosticStatus(
        level=LEVELS[level],
        name=name,
        message=text,
        hardware_id=hardware,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


class Diagnostics:
    """Counts what a node does and publishes it once a second.

    `condition` is a function that returns (level, text) for the node's own state; faults noted by `fault` stay
    until `clear`.
    """

    def __init__(self, node: Node, name: str, lockstep: bool, period: int, publisher: Publisher[Any]) -> None:
        self.condition: Callable[[], tuple[int, str]] = lambda: (OK, "running")
        self.inputs: dict[str, Input] = {}
        self.values: dict[str, Callable[[], object]] = {}
        self.groups: list[Callable[[], Mapping[str, object]]] = []  # of values that are reported together
        self.cycles = 0
        self.missed = 0
        self.latest = 0
        self.whole_run = WholeRun(period)
        self.latencies: deque[int] = deque(maxlen=WINDOW)
        self._faults: dict[str, str] = {}
        self._name = name
        self._lockstep = lockstep
        self._node = node
        self._publisher = publisher
        self._hardware = node.get_fully_qualified_name().lstrip("/")
        self._reported_at = time.monotonic()
        self._reported_cycles = 0

    def sampled(self) -> None:
        """A sample has come: counted, and its distance from the last one noted."""
        self.cycles += 1
        self.whole_run.sampled()

    def latency(self, nanoseconds: int) -> None:
        """Note one latency [ns]."""
        self.latencies.append(nanoseconds)
        self.whole_run.latency(nanoseconds)

    def lateness(self, nanoseconds: int) -> None:
        """Note how late a tick came [ns]; the worst since the last report is shown."""
        self.latest = max(self.latest, nanoseconds)

    def fault(self, kind: str, text: str) -> None:
        """An error that stays on /diagnostics until `clear`; logged the first time."""
        if kind not in self._faults:
            self._node.get_logger().error(text)
        self._faults[kind] = text

    def clear(self) -> None:
        """Forget the faults (after a reset)."""
        self._faults.clear()

    def percentiles(self) -> dict[str, float]:
        """Latency percentiles since the last report [µs]."""
        if not self.latencies:
            return {}
        ordered = sorted(self.latencies)
        count = len(ordered)
        picks = {"p50": count // 2, "p99": min(count - 1, count * 99 // 100), "max": count - 1}
        return {f"latency_{name}_us": ordered[place] * MICROSECOND for name, place in picks.items()}

    def _level(self) -> tuple[int, str]:
        if self._faults:
            return ERROR, "; ".join(self._faults.values())
        level, text = self.condition()
        silent = [item.name for item in self.inputs.values() if item.age() > STALE]
        if level == OK and silent:
            return WARN, f"{text}; nothing on {', '.join(silent)}"
        return level, text

    def status(self) -> DiagnosticStatus:
        """The node's status now; starts a new window for rate and latency."""
        now = time.monotonic()
        rate = (self.cycles - self._reported_cycles) / max(now - self._reported_at, 1e-9)
        self._reported_at, self._reported_cycles = now, self.cycles
        values: dict[str, object] = {
            "mode": "lockstep" if self._lockstep else "realtime",
            "rate_hz": f"{rate:.1f}",
            "cycles": self.cycles,
            "missed_deadlines": self.missed,
            "worst_tick_us": f"{self.latest * MICROSECOND:.1f}",
        }
        values |= {name: f"{value:.1f}" for name, value in self.percentiles().items()}
        for item in self.inputs.values():
            for count in ("received", "lost", "doubled", "refused", "others"):
                values[f"{item.name}.{count}"] = getattr(item, count)
            values[f"{item.name}.age_s"] = f"{item.age():.3f}"
        values |= {name: read() for name, read in self.values.items()}
        for group in self.groups:
            values |= group()
        self.latencies.clear()
        self.latest = 0
        level, text = self._level()
        return status_of(f"{self._hardware}: {self._name}", self._hardware, level, text, values)

    def event(self, part: str, level: int, text: str, values: dict[str, object]) -> None:
        """Publish something that has just happened, beside the report of every second, so that a recording has it."""
        self._send(status_of(f"{self._hardware}: {part}", self._hardware, level, text, values))

    def publish(self) -> None:
        """Publish the status, stamped with the wall clock."""
        self._send(self.status())

    def _send(self, status: DiagnosticStatus) -> None:
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)


SETTLING = 5_000_000_000  # of the start is left out [ns]


class WholeRun:
    """Counts durations in bins of a microsecond, so that its memory does not grow.

    Parameters
    ----------
    period : nominal distance of two samples [ns].
    """

    def __init__(self, period: int) -> None:
        self.jitter = Durations()
        self.latencies = Durations()
        self._period = period
        self._first = self._last = -1

    def sampled(self) -> None:
        """A sample is taken, or has come, now: how far its distance from the last one is from the period."""
        now = time.monotonic_ns()
        if self._settled(now):
            self.jitter.add(abs(now - self._last - self._period))
        self._last = now

    def latency(self, nanoseconds: int) -> None:
        """Note one latency [ns]."""
        if self._settled(time.monotonic_ns()):
            self.latencies.add(nanoseconds)

    def _settled(self, now: int) -> bool:
        if self._first < 0:
            self._first = now
        return now - self._first > SETTLING

    def lines(self) -> list[str]:
        """A line on each that was counted."""
        found = []
        for name, spread in {"period jitter": self.jitter, "latency": self.latencies}.items():
            if spread.count:
                figures = " ".join(f"{part} {value:.0f}" for part, value in spread.percentiles().items())
                found.append(f"whole run: {name} of {spread.count}: {figures} us")
        return found
