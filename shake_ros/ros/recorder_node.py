"""Node `recorder`: every message as it came, into a rosbag2 folder that survives a kill.

Callbacks only append bytes to a queue; one thread writes, so that none of them waits for a disk. In lock-step the time
of receipt is the stamp, so that two runs give the same recording whichever topic came first; in real time it is the
wall clock.
`recorder --recover PATH` makes a killed recording whole, without ROS running.
"""

from __future__ import annotations

import argparse
import struct
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.qos import QoSProfile

from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.recordings.bags import BagWriter, recover
from shake_ros.ros import interface, loop
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK, Input
from shake_ros.ros.frame import FIRST_STAMP, Behaviour, Frame, taken
from shake_ros.ros.interface import Topic, interface_class, matching, type_name

STAMP = struct.Struct("<iI")


class Reception:
    """One topic on its way to the writing thread.

    Parameters
    ----------
    profile : to subscribe with.

    Attributes
    ----------
    declared : full name, type and offered quality of service in rosbag2's form, from the first message on.
    number : of the topic in the recording, once it is written.
    """

    def __init__(self, recorder: Recorder, topic: Topic, profile: QoSProfile) -> None:
        self.count, self.number = 0, -1
        self.declared: tuple[str, str, list[dict[str, Any]] | None] = ("", "", None)
        self._recorder, self._topic = recorder, topic
        self.name = recorder.frame.resolved(topic.name)
        self._input = Input(topic.name, recorder.frame.period)
        self._subscription = recorder.frame.subscription(topic, self.arrived, profile=profile)

    def arrived(self, data: bytes) -> None:
        """A message, serialised."""
        if not self.count:
            self._declare()
        self.count += 1
        stamp = 0
        if self._topic.sampled:
            seconds, nanoseconds = STAMP.unpack_from(data, 4)
            stamp = seconds * SECOND + nanoseconds
            self._input.count(stamp)
        self._recorder.writing.put(self, self._recorder.receipt(stamp), data)

    def _declare(self) -> None:
        """At the first message: the type and the quality of service that the writers offer."""
        frame = self._recorder.frame
        publishers = frame.node.get_publishers_info_by_topic(self.name)
        offered = [profile_of(info.qos_profile) for info in publishers]
        self.declared = self.name, type_name(self._topic.type), offered[:1] or None
        if self._topic.sampled:
            frame.diagnostics.inputs[self._topic.name] = self._input
        frame.diagnostics.values[f"{self._topic.name}.count"] = lambda: self.count

    @property
    def newest(self) -> int:
        """Newest stamp [ns]; -1 where none has come, or none is asked for."""
        return self._input.last_stamp if self._topic.sampled and self.count else -1

    def take(self) -> None:
        """Take what has arrived but was not yet served."""
        for data, _ in taken(self._subscription):
            self.arrived(data)


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


class WritingThread:
    """Writes what `put` appends; all calls of the writer happen in this thread.

    Parameters
    ----------
    writer : recording, just made.
    flush_every : everything is handed to the operating system at least this often [s].
    limit : of the bytes that wait; what comes beyond is counted as dropped.
    """

    def __init__(self, writer: BagWriter, flush_every: float, limit: int) -> None:
        self.path: Path = writer.path
        self.waiting = 0  # bytes in the queue
        self.dropped = 0  # messages that found no room
        self.error = ""  # why writing ended, empty while it goes well
        self._writer = writer
        self._flush_every = flush_every
        self._limit = limit
        self._queue: deque[tuple[Reception, int, bytes]] = deque()
        self._added = 0  # bytes ever put, by the callbacks' thread
        self._written = 0  # bytes ever written, by this thread
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    def put(self, topic: Reception, received: int, data: bytes) -> None:
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
        queue, write = self._queue, self._writer.write
        while queue:
            for _ in range(min(BURST, len(queue))):
                topic, received, data = queue.popleft()
                if topic.number < 0:
                    topic.number = self._writer.add_topic(*topic.declared)
                write(topic.number, received, data)
                self._written += len(data)
            time.sleep(0)


LOOK_FOR = 0.2  # unknown topics are looked for this often [s]
MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class RecorderParameters(Parameters):
    """The node's own settings."""

    output: str = choice("folder of the recording; empty: shake_ and date in the current folder")
    topics: str = choice("names separated by blanks; empty: every topic of the interface")
    compression: str = choice("of the chunks", ("none", "zstd"))
    force: bool = quantity("", "replace an existing recording")
    flush_every: float = quantity("s", "a kill loses at most this", low=0.01, high=10.0)
    waiting_limit: float = quantity("MiB", "messages waiting for the disk", low=1.0, high=65536.0)


class Recorder(Behaviour):
    """Subscribes to everything named and hands bytes to the writing thread."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        own = frame.settings(RecorderParameters).value
        self.receptions: list[Reception] = []
        self._newest = FIRST_STAMP
        compression = "" if own.compression == "none" else own.compression
        path = Path(own.output).expanduser() if own.output else Path(time.strftime("shake_%Y_%m_%d-%H_%M_%S"))
        self.writing = WritingThread(
            BagWriter(path, compression, own.force), own.flush_every, int(own.waiting_limit * MEBIBYTE)
        )
        self._sought = set(own.topics.split())
        for name in own.topics.split() or interface.TOPICS:
            topic = interface.TOPICS.get(name)
            if topic is not None:
                self._sought.discard(name)
                self.receptions.append(Reception(self, topic, self._profile(topic)))
        if self._sought:
            frame.every(LOOK_FOR, self._look_for_topics)
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values["dropped"] = lambda: self.writing.dropped
        frame.diagnostics.values["waiting_bytes"] = lambda: self.writing.waiting
        frame.diagnostics.values["recorded_to_ns"] = self._recorded_to
        frame.node.get_logger().info(f"recording to {path}")

    def finish(self) -> None:
        """Take what has arrived but was not yet served, then complete the file."""
        for one in self.receptions:
            one.take()
        error = self.writing.close()
        total = sum(one.count for one in self.receptions)
        self.frame.node.get_logger().info(f"recorded {total} messages to {self.writing.path}")
        if error:
            raise ShakeError(f"{self.writing.path}: {error}; the recording is incomplete")

    def _profile(self, topic: interface.Topic) -> QoSProfile:
        """In lock-step the readers hold the writers back; in real time they take all that a writer still has."""
        if self.frame.lockstep and topic.sampled:
            return interface.LOCKSTEP_QOS
        return interface.REALTIME_RECORDER_QOS

    def receipt(self, stamp: int) -> int:
        """When a message of this stamp [ns] was received: in lock-step then, or at the newest where it has none."""
        self._newest = max(self._newest, stamp)
        return (stamp or self._newest) if self.frame.lockstep else self.frame.now()

    def _recorded_to(self) -> int:
        """The stamp up to which every sampled topic that has come is recorded [ns]; 0 before the first."""
        return min((one.newest for one in self.receptions if one.newest >= 0), default=0)

    def _look_for_topics(self) -> None:
        """Subscribe to topics outside of the interface once somebody publishes them."""
        node = self.frame.node
        known = dict(node.get_topic_names_and_types())
        for name in sorted(self._sought):
            resolved = node.resolve_topic_name(name)
            types = known.get(resolved, [])
            writers = node.get_publishers_info_by_topic(resolved)
            if not types or not writers:
                continue
            self._sought.discard(name)
            kind = interface_class(types[0])
            if kind is None:
                self.frame.diagnostics.fault(name, f"{name}: no Python package for type {types[0]}")
                continue
            topic = interface.Topic(name, kind, sampled=False)
            self.receptions.append(Reception(self, topic, matching([info.qos_profile for info in writers])))

    def _condition(self) -> tuple[int, str]:
        self.frame.diagnostics.cycles = total = sum(one.count for one in self.receptions)
        if self.writing.error:
            self.frame.diagnostics.fault("disk", f"{self.writing.path}: {self.writing.error}")
        if self.writing.dropped:
            self.frame.diagnostics.fault("slow", f"the disk is too slow: {self.writing.dropped} messages dropped")
        waiting = f"; no publisher yet on {', '.join(sorted(self._sought))}" if self._sought else ""
        return OK, f"{total} messages to {self.writing.path}{waiting}"


build = Recorder


def main(arguments: Sequence[str]) -> int:
    """Run the node, or recover a recording; returns the exit code."""
    if not any(text.startswith("--recover") for text in arguments):
        return loop.main(build, "recorder", arguments)
    parser = argparse.ArgumentParser(prog="recorder", description="Make a killed recording whole.")
    parser.add_argument("--recover", type=Path, required=True, metavar="PATH", help="folder or file of the recording")
    parser.add_argument("--out", type=Path, metavar="BAG", help="new folder; by default the old name, the old one kept")
    given = parser.parse_args(list(arguments))
    folder, count = recover(given.recover, given.out)
    print(f"{folder}: {count} messages recovered")
    return 0
