"""A node that notes what its thread did whenever a period took too long, and writes it at its end.

    PAUSES=FOLDER python -m benchmarks.realtime.traced NODE ROS_ARGUMENTS   # into FOLDER/NODE.json

A pause is a step (a tick, a datagram or a message) that comes more than LIMIT after it was due. What the thread did
since the step before is added up from what Python and Linux count: the garbage collector in any thread of the process
(`gc.callbacks`), the report on /diagnostics, the interlock's look into the graph that DDS discovered, the executor
beyond the time it was given, waiting for a processor (/proc/self/task/*/schedstat), page faults (`getrusage`), own
computation (the thread's processor time without these); the rest it slept, so its timer or its input was late.
"""

from __future__ import annotations

import functools
import gc
import json
import os
import resource
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from shake_ros.__main__ import main as shake
from shake_ros.bridge.table_link import Sample
from shake_ros.ros import loop
from shake_ros.ros.diagnostics import Diagnostics
from shake_ros.ros.frame import Reader
from shake_ros.ros.hardware_bridge_node import HardwareBridge
from shake_ros.ros.interlock import NodeInterlock

LIMIT = 2_000_000  # a step so much later than due is a pause [ns]
PERIOD = 1_000_000  # [ns]
SETTLING = 5_000_000_000  # of the start is left out [ns]
STEPPED_BY = {"observer": "joint_states", "controller": "estimate"}  # nodes that messages step
PARTS = ("collector", "report", "discovery", "executor")


class Tracer:
    """Adds up what the thread that steps has done, from step to step."""

    def __init__(self) -> None:
        self.spent = dict.fromkeys(PARTS, 0)
        self.pauses: list[dict[str, float]] = []
        self.steps = self.faults = 0
        self._before: dict[str, int] = {}
        self._first = self._thread = self._schedstat = 0
        self._collecting = self._elsewhere = 0
        gc.callbacks.append(self._collector)

    def _collector(self, phase: str, _info: dict[str, int]) -> None:
        if phase == "start":
            self._collecting = time.monotonic_ns()
            return
        took = time.monotonic_ns() - self._collecting
        self.spent["collector"] += took
        if threading.get_native_id() != self._thread:  # it has the interpreter's lock: the stepping thread sleeps
            self._elsewhere += took

    def timed(self, part: str, owner: Any, name: str, allowed: bool = False) -> None:
        """Count the time of a method under `part`; where `allowed`, only beyond its first argument [s]."""
        inner: Callable[..., Any] = getattr(owner, name)

        @functools.wraps(inner)
        def outer(this: Any, *arguments: Any) -> Any:
            begun, others = time.monotonic_ns(), sum(self.spent.values())
            try:
                return inner(this, *arguments)
            finally:
                if threading.get_native_id() == self._thread:
                    took = time.monotonic_ns() - begun - (sum(self.spent.values()) - others)
                    self.spent[part] += max(0, took - (round(arguments[0] * 1e9) if allowed else 0))

        setattr(owner, name, outer)

    def seconds(self) -> float:
        """How long it has looked [s]."""
        return max(1e-3, (self._before.get("at", 0) - self._first - SETTLING) / 1e9)

    def step(self) -> None:
        """A step begins."""
        now = time.monotonic_ns()
        if not self._thread:
            self._first, self._thread = now, threading.get_native_id()
            self._schedstat = os.open(f"/proc/self/task/{self._thread}/schedstat", os.O_RDONLY)
        usage = resource.getrusage(resource.RUSAGE_THREAD)
        waited = int(os.pread(self._schedstat, 64, 0).split()[1])
        present = {
            "at": now,
            "processor": time.thread_time_ns(),
            "waited": waited,
            "faults": usage.ru_minflt + usage.ru_majflt,
            "elsewhere": self._elsewhere,
            **self.spent,
        }
        before, self._before = self._before, present
        if not before or now - self._first < SETTLING:
            return
        self.steps += 1
        since = {name: present[name] - value for name, value in before.items()}
        self.faults += since["faults"]
        if since["at"] > PERIOD + LIMIT:
            own = since["processor"] - sum(since[part] for part in PARTS) + since["elsewhere"]
            known = {part: since[part] for part in PARTS} | {"computation": max(0, own), "waited": since["waited"]}
            asleep = since["at"] - since["processor"] - since["waited"] - since["elsewhere"]
            parts = {name: value / 1e6 for name, value in {**known, "asleep": max(0, asleep)}.items()}
            self.pauses.append({"late": (since["at"] - PERIOD) / 1e6, **parts, "faults": since["faults"]})


def trace(node: str) -> Tracer:
    """Look into the loop of a node of this process."""
    tracer = Tracer()
    tracer.timed("report", Diagnostics, "publish")
    tracer.timed("discovery", NodeInterlock, "_look_for_two")
    tracer.timed("executor", loop.NodeLoop, "attend", allowed=True)
    if node in STEPPED_BY:
        arrived = Reader._arrived

        def hear(self: Reader, data: bytes) -> None:
            if self.input.name == STEPPED_BY[node]:
                tracer.step()
            arrived(self, data)

        Reader._arrived = hear  # type: ignore[method-assign]  # what is traced
    elif node == "hardware_bridge":
        publish = HardwareBridge._publish

        def send(self: HardwareBridge, sample: Sample) -> None:
            tracer.step()
            publish(self, sample)

        HardwareBridge._publish = send  # type: ignore[method-assign]  # what is traced
    else:
        sleep = loop.sleep_until

        def wake(deadline: int) -> None:
            sleep(deadline)
            tracer.step()

        loop.sleep_until = wake
    return tracer


def main() -> int:
    tracer = trace(sys.argv[1])
    try:
        return shake(sys.argv[1:])
    finally:
        found = {"steps": tracer.steps, "seconds": tracer.seconds(), "faults": tracer.faults, "pauses": tracer.pauses}
        (Path(os.environ["PAUSES"]) / f"{sys.argv[1]}.json").write_text(json.dumps(found))


if __name__ == "__main__":
    sys.exit(main())
