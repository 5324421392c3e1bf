"""Node `recorder`: every message as it came, into a rosbag2 folder that survives a kill.

Callbacks only append bytes to a queue; one thread writes. In lock-step a message's time of receipt is the newest
stamp, so that two runs give the same recording; in real time it is the wall clock.
`recorder --recover PATH` makes a killed recording whole, without ROS running.
"""

from __future__ import annotations

import argparse
import importlib
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.data.recordings import BagWriter, recover
from shake_ros.ros import interface, loop
from shake_ros.ros.diagnostics import OK, Input
from shake_ros.ros.frame import FIRST_STAMP, Frame, node_settings
from shake_ros.ros.writing_thread import Declaration, WritingThread

LOOK_FOR = 0.2  # unknown topics are looked for this often [s]
MEBIBYTE = 1 << 20
SECOND = 1_000_000_000
STAMP = struct.Struct("<iI")


@dataclass(frozen=True)
class RecorderParameters(Parameters):
    """The node's own settings."""

    output: str = choice("folder of the recording; empty: shake_ and date in the current folder")
    topics: str = choice("names separated by blanks; empty: every topic of the interface")
    compression: str = choice("of the chunks", ("none", "zstd"))
    force: bool = quantity("", "replace an existing recording")
    flush_every: float = quantity("s", "a kill costs at most this", low=0.01, high=10.0)
    waiting_limit: float = quantity("MiB", "messages that the disk has not taken yet", low=1.0, high=65536.0)


class Recorder:
    """Subscribes to everything named and hands bytes to the writing thread."""

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.ticks = False
        settings = RecorderParameters.from_mapping(node_settings("recorder"), "config/node/recorder.yaml")
        own = frame.parameters.declare(settings).value
        self._counts: dict[str, int] = {}
        self._newest = FIRST_STAMP
        self._taken: dict[str, Any] = {}
        self._arrived: dict[str, Callable[[bytes], None]] = {}
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
                self._subscribe(topic.name, topic.type, self._profile(topic), topic.sampled)
        if self._sought:
            frame.node.create_timer(LOOK_FOR, self._look_for_topics)
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values["dropped"] = lambda: self._writing.dropped
        frame.diagnostics.values["waiting_bytes"] = lambda: self._writing.waiting
        frame.node.get_logger().info(f"recording to {path}")

    def start(self) -> None:
        """Nothing: recording began with the subscriptions."""

    def tick(self, stamp: int, steps: int) -> None:
        """Nothing: messages drive this node."""

    def finish(self) -> None:
        """Take what has arrived but was not yet served, then complete the file."""
        for topic, subscription in self._taken.items():
            arrived, handle = self._arrived[topic], subscription.handle
            with handle:
                while (taken := handle.take_message(subscription.msg_type, True)) is not None:
                    arrived(taken[0])
        error = self._writing.close()
        total = sum(self._counts.values())
        self.frame.node.get_logger().info(f"recorded {total} messages to {self._writing.path}")
        if error:
            raise ShakeError(f"{self._writing.path}: {error}; the recording is incomplete")

    def _profile(self, topic: interface.Topic) -> QoSProfile:
        """In lock-step the readers hold the writers back; in real time they take all that a writer still has."""
        if self.frame.lockstep and topic.sampled:
            return interface.LOCKSTEP_QOS
        return interface.REALTIME_RECORDER_QOS

    def _subscribe(self, name: str, kind: Any, profile: QoSProfile, sampled: bool) -> None:
        resolved = self.frame.node.resolve_topic_name(name)
        arrived = self._receiver(name, resolved, kind, sampled)
        subscription = self.frame.node.create_subscription(kind, name, arrived, profile, raw=True)
        self._taken[resolved] = subscription
        self._arrived[resolved] = arrived

    def _receiver(self, name: str, resolved: str, kind: Any, sampled: bool) -> Callable[[bytes], None]:
        """The callback of one topic: count, time, append."""
        counted = Input(name, self.frame.period)
        lockstep, put, counts = self.frame.lockstep, self._writing.put, self._counts
        topic = len(counts)
        counts[resolved] = 0

        def arrived(data: bytes) -> None:
            if not counts[resolved]:
                self._declare(topic, resolved, kind, counted, sampled)
            counts[resolved] += 1
            if sampled:
                seconds, nanoseconds = STAMP.unpack_from(data, 4)
                stamp = seconds * SECOND + nanoseconds
                counted.count(stamp)
                self._newest = max(self._newest, stamp)
            put(topic, self._newest if lockstep else time.time_ns(), data)

        return arrived

    def _declare(self, topic: int, resolved: str, kind: Any, counted: Input, sampled: bool) -> None:
        """At a topic's first message: its type and the quality of service that its writers offer."""
        module = kind.__module__.split(".")
        offered = [_profile_of(info.qos_profile) for info in self.frame.node.get_publishers_info_by_topic(resolved)]
        self._writing.declare(topic, Declaration(resolved, f"{module[0]}/msg/{kind.__name__}", offered[:1]))
        if sampled:
            self.frame.diagnostics.inputs[counted.name] = counted
        self.frame.diagnostics.values[f"{counted.name}.count"] = lambda: self._counts[resolved]

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
            kind = message_class(types[0])
            if kind is None:
                self.frame.diagnostics.fault(name, f"{name}: no Python package for type {types[0]}")
                continue
            self._subscribe(name, kind, _matching([info.qos_profile for info in writers]), sampled=False)

    def _condition(self) -> tuple[int, str]:
        self.frame.diagnostics.cycles = total = sum(self._counts.values())
        if self._writing.error:
            self.frame.diagnostics.fault("disk", f"{self._writing.path}: {self._writing.error}")
        if self._writing.dropped:
            self.frame.diagnostics.fault("slow", f"the disk is too slow: {self._writing.dropped} messages dropped")
        waiting = f"; no publisher yet on {', '.join(sorted(self._sought))}" if self._sought else ""
        return OK, f"{total} messages to {self._writing.path}{waiting}"


def message_class(name: str) -> Any:
    """The message class of a type such as sensor_msgs/msg/Imu; None where its package is not installed."""
    package, _, kind = name.replace("/msg/", "/").partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), kind)
    except (ImportError, AttributeError):
        return None


def _matching(offered: list[QoSProfile]) -> QoSProfile:
    """A profile that every writer of a topic can serve."""
    profile = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
    if any(one.reliability != ReliabilityPolicy.RELIABLE for one in offered):
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    if all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in offered):
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    return profile


def _profile_of(profile: QoSProfile) -> dict[str, Any]:
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


def build(frame: Frame) -> Recorder:
    """The node in its frame."""
    return Recorder(frame)


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
