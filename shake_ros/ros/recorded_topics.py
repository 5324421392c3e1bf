"""The topics of a recording: received, counted, timed; message classes by name; qualities of service as rosbag2's."""

from __future__ import annotations

import importlib
import struct
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import Input
from shake_ros.ros.frame import FIRST_STAMP, Frame
from shake_ros.ros.interface import Topic
from shake_ros.ros.writing_thread import Declaration, WritingThread

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
    profile : to subscribe with. number : of the topic in the recording.
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
