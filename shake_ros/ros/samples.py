"""Writers and readers of sampled topics: packed, counted, refused where they are no samples."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from shake_ros.core.quantities import ShakeError
from shake_ros.ros.conversions import OtherJointError, codec
from shake_ros.ros.diagnostics import ERROR, OK, Input
from shake_ros.ros.interface import Topic

if TYPE_CHECKING:
    from shake_ros.ros.frame import Frame

AGAIN = 1e-4  # pause before a message is offered again [s]; at SCHED_FIFO the reader would never run without it
BLOCKED = 30.0  # a reader that takes nothing for this long [s] has hung


class Writer:
    """Publishes the samples of one topic."""

    def __init__(self, frame: Frame, topic: Topic) -> None:
        self.publisher = frame.publisher(topic)
        self._frame = frame
        self._topic = topic
        packer = self.codec = codec(topic)
        self._encode = packer.encode
        # what `publish` does with bytes, without its checks
        self._publish = self.publisher.handle.publish_raw if packer.packed else self.publisher.publish

    def send(self, stamp: int, *values: float) -> None:
        """Publish a sample; where a lock-step reader is behind, wait for it."""
        data = self._encode(stamp, values)
        try:
            self._publish(data)
        except RuntimeError:
            self._insist(data)

    def _insist(self, data: Any) -> None:
        give_up = time.monotonic() + BLOCKED
        while not self._published(data):
            if self._frame.stopping or not self._frame.node.context.ok():
                return
            if time.monotonic() > give_up:
                raise RuntimeError(f"{self._topic.name}: a reader has taken nothing for {BLOCKED:g} s")
            time.sleep(AGAIN)

    def _published(self, data: Any) -> bool:
        try:
            self._publish(data)
        except RuntimeError:
            return False
        return True


class Reader:
    """Takes the samples of one topic, counts them and passes on what is whole.

    Parameters
    ----------
    accept : called with (stamp [ns], *numbers).
    refuse : called with (stamp, reason) for NaN, infinity, unreadable and unstamped messages; −1 where unknown.
    doubled : called with the stamp of a message that is not newer than the one before.
    """

    def __init__(
        self,
        frame: Frame,
        topic: Topic,
        accept: Callable[..., None],
        refuse: Callable[[int, str], None] | None = None,
        doubled: Callable[[int], None] | None = None,
    ) -> None:
        self.input = Input(topic.name, frame.period)
        frame.diagnostics.inputs[topic.name] = self.input
        self._frame = frame
        self._topic = topic
        self._accept = accept
        self._refuse = refuse
        self._doubled = doubled
        self.codec = codec(topic)
        self._decode = self.codec.decode
        self.subscription = frame.subscription(topic, self._arrived)

    def _arrived(self, data: bytes) -> None:
        try:
            stamp, values = self._decode(data)
        except OtherJointError as error:
            self.input.others += 1
            return self._frame.say(OK, f"{error}: left out", key=self._topic.name)
        except ShakeError as error:
            return self._refused(-1, str(error))
        if stamp <= 0:
            return self._refused(stamp, f"{self._topic.name}: no stamp (header.stamp is 0), refused")
        if not self.input.count(stamp):
            if self._doubled is not None:
                self._doubled(stamp)
            return None
        for value in values:
            if not math.isfinite(value):
                return self._refused(stamp, f"{self._topic.name}: {value} at {stamp * 1e-9:.6f} s refused")
        return self._accept(stamp, *values)

    def _refused(self, stamp: int, reason: str) -> None:
        self.input.refused += 1
        self._frame.say(ERROR, reason, key=self._topic.name)
        if self._refuse is not None:
            self._refuse(stamp, reason)

    def take(self) -> int:
        """Take all that has come, without waiting; returns when the newest arrived [ns, wall clock], 0 if nothing."""
        arrived = 0
        handle: Any = self.subscription.handle
        with handle:
            while (taken := handle.take_message(self._topic.type, True)) is not None:
                data, info = taken
                arrived = info["received_timestamp"]
                self._arrived(data)
        return arrived
