"""What a process asks of the operating system to keep time, and how well it keeps it: counts within a second, spreads.

Each is asked for by itself; what the system refuses is said, and the process goes on without it
(docs/howto/realtime.md).
"""

from __future__ import annotations

import ctypes
import gc
import os
from array import array
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from shake_ros.quantities import Parameters, quantity

MCL_CURRENT_AND_FUTURE = 3
THREADS = Path("/proc/self/task")
STATUS = Path("/proc/self/status")
WAKING = Path("/dev/cpu_dma_latency")  # while it is held open, waking takes no longer than what is written [us]
AT_ONCE = (0).to_bytes(4, "little")
ANY = -1
MANY = 5000  # objects, whose collection takes about a millisecond


@dataclass(frozen=True)
class RealtimeParameters(Parameters):
    """What a process asks for."""

    enabled: bool = quantity("", "whether priority, processor and locked memory are asked for")
    priority: int = quantity("-", "SCHED_FIFO priority of every thread; 0: usual scheduling", low=0, high=99)
    cpu: int = quantity("-", "the only processor to run on; -1: any", low=ANY, high=4095)
    lock_memory: bool = quantity("", "keep all memory, present and future, from being paged out")
    freeze_collector: bool = quantity("", "the garbage collector runs once a second, on new objects only")
    stay_awake: bool = quantity("", "keep all processors from sleeping while idle")


def _each_thread(change: Callable[[int], None]) -> None:
    """Do it for every thread of this process; those that it starts later inherit priority and processor."""
    for thread in os.listdir(THREADS):
        try:
            change(int(thread))
        except ProcessLookupError:  # ended meanwhile
            continue


def _schedule(priority: int) -> None:
    _each_thread(lambda thread: os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority)))


def _lock_memory() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT_AND_FUTURE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


class _Awake:
    """Holds the processors awake from `hold` until the process ends, or `release`."""

    def __init__(self) -> None:
        self.file = -1

    def hold(self) -> None:
        if self.file < 0:
            self.file = os.open(WAKING, os.O_WRONLY)
            os.write(self.file, AT_ONCE)

    def release(self) -> None:
        if self.file >= 0:
            os.close(self.file)
            self.file = -1


awake = _Awake()


def ask_for(wanted: RealtimeParameters) -> str:
    """Ask for all that is wanted. Returns a line on what was refused and why, empty where nothing was."""
    if not wanted.enabled:
        return ""
    steps: dict[str, Callable[[], None]] = {}
    if wanted.lock_memory:
        steps["locked memory"] = _lock_memory
    if wanted.priority:  # before the processor: there, others may have the priority already and leave no time
        steps[f"SCHED_FIFO {wanted.priority}"] = lambda: _schedule(wanted.priority)
    if wanted.cpu != ANY:
        steps[f"processor {wanted.cpu}"] = lambda: _each_thread(lambda one: os.sched_setaffinity(one, {wanted.cpu}))
    if wanted.stay_awake:
        steps["processors that stay awake"] = awake.hold
    refused = []
    for name, step in steps.items():
        try:
            step()
        except OSError as error:
            refused.append(f"{name} ({error.strerror})")
    return f"real time: runs without {', '.join(refused)}" if refused else ""


def hold_collector() -> None:
    """Keep the garbage collector out of every step: what is there now stays, what follows waits for `collect`.

    A full collection of a node with its compiled code takes 90 ms; after this one, 0.04 ms. (To count what is frozen
    takes 13 ms: nobody asks for that here.)
    """
    gc.disable()
    gc.freeze()


def collect() -> None:
    """Let a held collector look at what is new; where much of it stays, hold that still as well.

    Otherwise what one late import leaves is looked at each second: 56 000 objects stopped the bridge for 20 ms.
    """
    if not gc.isenabled():
        gc.collect()
        if len(gc.get_objects()) > MANY:
            gc.freeze()


def release_collector() -> None:
    """Undo `hold_collector`."""
    if not gc.isenabled():
        gc.unfreeze()
        gc.enable()


def in_force() -> str:
    """What this process has of it, as the system says.

    >>> in_force().split(",")[0] in ("usual scheduling", f"SCHED_FIFO {os.sched_getparam(0).sched_priority}")
    True
    """
    fifo = os.sched_getscheduler(0) == os.SCHED_FIFO
    processors = sorted(os.sched_getaffinity(0))
    locked = next((int(s.split()[1]) for s in STATUS.read_text().splitlines() if s.startswith("VmLck:")), 0)
    return ", ".join(
        (
            f"SCHED_FIFO {os.sched_getparam(0).sched_priority}" if fifo else "usual scheduling",
            f"processor {processors[0]}" if len(processors) == 1 else f"{len(processors)} processors",
            "memory locked" if locked else "memory not locked",
            *(["processors awake"] if awake.file >= 0 else []),
            "collector held" if not gc.isenabled() else "collector at work",
        )
    )


SECOND = 1_000_000_000
MICROSECOND = 1000
LONGEST = 100_000  # [µs] longer ones share the last bin


class LastSecond:
    """A sliding sum of counts.

    >>> missed = LastSecond()
    >>> missed.add(0, 3)
    >>> missed.add(900_000_000, 2)
    >>> missed.total(950_000_000), missed.total(1_500_000_000), missed.total(3_000_000_000)
    (5, 2, 0)
    """

    def __init__(self) -> None:
        self._events: deque[tuple[int, int]] = deque()
        self._sum = 0

    def add(self, now: int, count: int) -> None:
        """Note `count` events at `now` [ns]."""
        self._events.append((now, count))
        self._sum += count

    def total(self, now: int) -> int:
        """Events within the second before `now` [ns]."""
        while self._events and now - self._events[0][0] > SECOND:
            self._sum -= self._events.popleft()[1]
        return self._sum


class Durations:
    """Percentiles of durations, counted in bins of a microsecond: its memory does not grow.

    >>> spread = Durations()
    >>> for k in range(1, 1001):
    ...     spread.add(k * 1000)
    >>> spread.count, spread.percentiles()
    (1000, {'p50': 500.0, 'p99': 990.0, 'p999': 999.0, 'max': 1000.0})
    """

    def __init__(self) -> None:
        self.count = 0
        self.longest = 0
        self._bins = array("q", bytes(8 * (LONGEST + 1)))

    def add(self, duration: int) -> None:
        """Count a duration [ns]."""
        self.count += 1
        self.longest = max(self.longest, duration)
        self._bins[min(max(duration // MICROSECOND, 0), LONGEST)] += 1

    def percentiles(self) -> dict[str, float]:
        """Median, 99 %, 99.9 % and the longest [µs]; empty before the first."""
        if self.count == 0:
            return {}
        found, total = {}, 0
        parts = {"p50": 0.5, "p99": 0.99, "p999": 0.999}
        for place, number in enumerate(self._bins):
            total += number
            for name, part in parts.items():
                if name not in found and total >= part * self.count:
                    found[name] = float(place)
        return {**found, "max": self.longest / MICROSECOND}
