"""The topics of a recording: received, counted, timed; message classes by name; qualities of service as rosbag2's.

A thread of its own takes messages off a queue and writes them, so that no callback waits for a disk.
"""

from __future__ import annotations

import importlib
import struct
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from shake_ros.data.recordings import BagWriter
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import Input
from shake_ros.ros.frame import FIRST_STAMP, Frame
from shake_ros.ros.interface import Topic

STAMP = struct.Struct("<iI")


class ReceiptClock:
    """When a message was received: in lock-step the newest stamp, as in any other run; else the node's clock."""

    def __init__(self, frame: Frame) -> None:
        self._frame = frame
        self._newest = FIRST_STAMP

    def stamped(self, stamp: int) -> None:
        """A sample of this instant [ns] has come."""
        self._newest = max(self._newest, stamp)

    def now(self) -> int:
        """[ns]"""
        return self._newest if self._frame.lockstep else self._frame.now()


class Reception:
    """One topic on its way to the writing thread.

    Parameters
    ----------
    profile : to subscribe with.
    number : of the topic in the recording.
    """

    def __init__(
        self,
        frame: Frame,
        topic: Topic,
        profile: QoSProfile,
        clock: ReceiptClock,
        writing: WritingThread,
        number: int,
    ) -> None:
        self.count = 0
        self._frame, self._topic, self._clock, self._writing, self._number = frame, topic, clock, writing, number
        self.name = frame.resolved(topic.name)
        self._input = Input(topic.name, frame.period)
        self._subscription = frame.subscription(topic, self.arrived, profile=profile)

    def arrived(self, data: bytes) -> None:
        """A message, serialised."""
        if not self.count:
            self._declare()
        self.count += 1
        if self._topic.sampled:
            seconds, nanoseconds = STAMP.unpack_from(data, 4)
            stamp = seconds * SECOND + nanoseconds
            self._input.count(stamp)
            self._clock.stamped(stamp)
        self._writing.put(self._number, self._clock.now(), data)

    def _declare(self) -> None:
        """At the first message: the type and the quality of service that the writers offer."""
        kind, diagnostics = self._topic.type, self._frame.diagnostics
        publishers = self._frame.node.get_publishers_info_by_topic(self.name)
        offered = [profile_of(info.qos_profile) for info in publishers]
        package = kind.__module__.split(".")[0]
        self._writing.declare(self._number, Declaration(self.name, f"{package}/msg/{kind.__name__}", offered[:1]))
        if self._topic.sampled:
            diagnostics.inputs[self._topic.name] = self._input
        diagnostics.values[f"{self._topic.name}.count"] = lambda: self.count

    @property
    def newest(self) -> int:
        """Newest stamp [ns]; -1 where none has come, or none is asked for."""
        return self._input.last_stamp if self._topic.sampled and self.count else -1

    def take(self) -> None:
        """Take what has arrived but was not yet served."""
        handle: Any = self._subscription.handle
        with handle:
            while (taken := handle.take_message(self._subscription.msg_type, True)) is not None:
                self.arrived(taken[0])


def interface_class(name: str) -> Any:
    """The class of a type such as sensor_msgs/msg/Imu or std_srvs/srv/Trigger; None where its package is missing.

    >>> interface_class("std_srvs/srv/Trigger").__name__, interface_class("nowhere/msg/Thing")
    ('Trigger', None)
    """
    package, *folder, kind = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{folder[0] if folder else 'msg'}"), kind)
    except (ImportError, AttributeError, ValueError):
        return None


def matching(offered: list[QoSProfile]) -> QoSProfile:
    """A profile that every writer of a topic can serve."""
    profile = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
    if any(one.reliability != ReliabilityPolicy.RELIABLE for one in offered):
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    if all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in offered):
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile


def profile_of(profile: QoSProfile) -> dict[str, Any]:
    """A profile in rosbag2's form."""

    def span(duration: Any) -> dict[str, int]:
        return {"sec": duration.nanoseconds // SECOND, "nsec": duration.nanoseconds % SECOND}

    return {
        "history": int(profile.history),
        "depth": int(profile.depth),
        "reliability": int(profile.reliability),
        "durability": int(profile.durability),
        "deadline": span(profile.deadline),
        "lifespan": span(profile.lifespan),
        "liveliness": int(profile.liveliness),
        "liveliness_lease_duration": span(profile.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": bool(profile.avoid_ros_namespace_conventions),
    }


PAUSE = 0.02  # between two looks at the queue [s]
BURST = 500  # messages written before other threads get a turn


@dataclass(frozen=True)
class Declaration:
    """A topic as a recording declares it: full name, type, offered quality of service in rosbag2's form."""

    name: str
    type: str
    profiles: list[dict[str, Any]]


class WritingThread:
    """Writes what `put` appends; all calls of the writer happen in this thread.

    Parameters
    ----------
    writer : recording, just made.
    flush_every : everything is handed to the operating system at least this often [s].
    limit : of the bytes that wait; what comes beyond is counted as dropped.

    Attributes
    ----------
    waiting : bytes in the queue.
    dropped : messages that found no room.
    error : why writing ended, empty while it goes well.
    """

    def __init__(self, writer: BagWriter, flush_every: float, limit: int) -> None:
        self.path: Path = writer.path
        self.waiting = 0
        self.dropped = 0
        self.error = ""
        self._writer = writer
        self._flush_every = flush_every
        self._limit = limit
        self._queue: deque[tuple[int, int, bytes]] = deque()
        self._declared: dict[int, Declaration] = {}
        self._numbers: dict[int, int] = {}
        self._added = 0  # bytes ever put, by the callbacks' thread
        self._written = 0  # bytes ever written, by this thread
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    def declare(self, topic: int, declaration: Declaration) -> None:
        """Say what a topic is, before its first message."""
        self._declared[topic] = declaration

    def put(self, topic: int, received: int, data: bytes) -> None:
        """Append a message with its time of receipt [ns]; never waits."""
        self.waiting = self._added - self._written
        if self.waiting > self._limit or self.error:
            self.dropped += 1
            return
        self._added += len(data)
        self._queue.append((topic, received, data))

    def close(self) -> str:
        """Write what is left and complete the recording; returns the error, empty where all went well."""
        self._closing.set()
        self._thread.join()
        return self.error

    def _run(self) -> None:
        try:
            flushed = time.monotonic()
            while not self._closing.is_set():
                self._closing.wait(PAUSE)
                self._drain()
                if time.monotonic() - flushed >= self._flush_every - PAUSE:
                    flushed = time.monotonic()
                    self._writer.flush()
            self._drain()
            self._writer.close()
        except OSError as error:
            self.error = error.strerror or str(error)
            self._queue.clear()

    def _drain(self) -> None:
        queue, numbers, write = self._queue, self._numbers, self._writer.write
        while queue:
            for _ in range(min(BURST, len(queue))):
                topic, received, data = queue.popleft()
                if topic not in numbers:
                    declared = self._declared[topic]
                    numbers[topic] = self._writer.add_topic(declared.name, declared.type, declared.profiles or None)
                write(numbers[topic], received, data)
                self._written += len(data)
            time.sleep(0)
