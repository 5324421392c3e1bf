"""Node `recorder`: every message as it came, into a rosbag2 folder that survives a kill.

Callbacks only append bytes to a queue; one thread writes. In lock-step a message's time of receipt is the newest
stamp, so that two runs give the same recording; in real time it is the wall clock.
`recorder --recover PATH` makes a killed recording whole, without ROS running.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rclpy.qos import QoSProfile

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.data.recordings import BagWriter, recover
from shake_ros.ros import interface, loop
from shake_ros.ros.diagnostics import OK
from shake_ros.ros.frame import Behaviour, Frame
from shake_ros.ros.recorded_topics import ReceiptClock, Reception, WritingThread, interface_class, matching

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
        self._clock = ReceiptClock(frame)
        compression = "" if own.compression == "none" else own.compression
        path = Path(own.output).expanduser() if own.output else Path(time.strftime("shake_%Y_%m_%d-%H_%M_%S"))
        self._writing = WritingThread(
            BagWriter(path, compression, own.force), own.flush_every, int(own.waiting_limit * MEBIBYTE)
        )
        self._sought = set(own.topics.split())
        for name in own.topics.split() or interface.TOPICS:
            topic = interface.TOPICS.get(name)
            if topic is not None:
                self._sought.discard(name)
                self._receive(topic, self._profile(topic))
        if self._sought:
            frame.every(LOOK_FOR, self._look_for_topics)
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values["dropped"] = lambda: self._writing.dropped
        frame.diagnostics.values["waiting_bytes"] = lambda: self._writing.waiting
        frame.diagnostics.values["recorded_to_ns"] = self._recorded_to
        frame.node.get_logger().info(f"recording to {path}")

    def finish(self) -> None:
        """Take what has arrived but was not yet served, then complete the file."""
        for one in self.receptions:
            one.take()
        error = self._writing.close()
        total = sum(one.count for one in self.receptions)
        self.frame.node.get_logger().info(f"recorded {total} messages to {self._writing.path}")
        if error:
            raise ShakeError(f"{self._writing.path}: {error}; the recording is incomplete")

    def _profile(self, topic: interface.Topic) -> QoSProfile:
        """In lock-step the readers hold the writers back; in real time they take all that a writer still has."""
        if self.frame.lockstep and topic.sampled:
            return interface.LOCKSTEP_QOS
        return interface.REALTIME_RECORDER_QOS

    def _receive(self, topic: interface.Topic, profile: QoSProfile) -> None:
        number = len(self.receptions)
        self.receptions.append(Reception(self.frame, topic, profile, self._clock, self._writing, number))

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
            self._receive(topic, matching([info.qos_profile for info in writers]))

    def _condition(self) -> tuple[int, str]:
        self.frame.diagnostics.cycles = total = sum(one.count for one in self.receptions)
        if self._writing.error:
            self.frame.diagnostics.fault("disk", f"{self._writing.path}: {self._writing.error}")
        if self._writing.dropped:
            self.frame.diagnostics.fault("slow", f"the disk is too slow: {self._writing.dropped} messages dropped")
        waiting = f"; no publisher yet on {', '.join(sorted(self._sought))}" if self._sought else ""
        return OK, f"{total} messages to {self._writing.path}{waiting}"


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
