"""Node `player`: a recording's messages again, byte for byte, with the recorded timing."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rclpy.duration import Duration

from shake_ros.quantities import Parameters, ShakeError, choice, quantity, unknown_name
from shake_ros.recordings.bags.bag import Bag, Message
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK
from shake_ros.ros.frame import DELIVERY, SHARED, Behaviour, Frame, insist
from shake_ros.ros.interface import interface_class

LONGEST_SLEEP = 0.1  # a pause looks for a stop this often [s]


@dataclass(frozen=True)
class PlayerParameters(Parameters):
    """The node's own settings."""

    input: str = choice("recording to play")
    topics: str = choice("names separated by blanks; empty: all")
    speed: float = quantity("-", "recorded seconds per second", low=0.001, high=1000.0)
    loop: bool = quantity("", "start again at the end")
    start_offset: float = quantity("s", "skip this much at the beginning", low=0.0, high=1e6)
    clock_rate: float = quantity("Hz", "of /clock, 0 for none", low=0.0, high=10000.0)


class Player(Behaviour):
    """Publishes from a thread of its own with absolute deadlines; ends the node after the last message."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self._own = frame.settings(PlayerParameters).value
        if not self._own.input:
            raise ShakeError("parameter input: the recording to play is needed")
        self._bag = Bag(self._own.input)
        self._clock = frame.writer(interface.CLOCK) if self._own.clock_rate > 0 else None
        self._publishers = {name: made for name in self._chosen() if (made := self._publisher(name)) is not None}
        if not self._publishers:
            self._bag.close()
            raise ShakeError(f"{self._own.input}: no message to play")
        self._now, self._error = 0, ""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._play, name="playing", daemon=True)
        frame.diagnostics.condition = lambda: (OK, f"playing {self._own.input}")
        frame.diagnostics.values["played_s"] = lambda: f"{self._now / SECOND:.3f}"

    def start(self) -> None:
        """Play, once the awaited readers are there."""
        self._thread.start()

    def finish(self) -> None:
        """Stop in the middle, or after the last message."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._bag.close()
        if self._error:
            raise ShakeError(f"{self._own.input}: {self._error}")

    def _chosen(self) -> list[str]:
        """Full names of the topics to play, by full name or last component."""
        available = {name: topic for name, topic in self._bag.topics.items() if topic.count and not topic.refusal}
        names = [name for name in available if self._clock is None or name != interface.CLOCK.name]
        wanted = self._own.topics.split()
        for one in wanted:
            if not any(name == one or name.rsplit("/", 1)[-1] == one for name in names):
                raise unknown_name("topic", one, names, self._own.input)
        return [name for name in names if not wanted or name in wanted or name.rsplit("/", 1)[-1] in wanted]

    def _publisher(self, name: str) -> Any:
        topic = self._bag.topics[name]
        kind = interface_class(topic.type)
        if kind is None:
            self.frame.node.get_logger().warning(f"{name}: no Python package for type {topic.type}; left out")
            return None
        if name not in {one.name for one in SHARED}:
            self.frame.exclusive.take("topic", self.frame.resolved(f"/{name.lstrip('/')}"))
        return self.frame.node.create_publisher(kind, f"/{name.lstrip('/')}", interface.REALTIME_QOS)

    def _play(self) -> None:
        try:
            played = self._pass()
            while self._own.loop and played and not self._stopping.is_set():
                played = self._pass()
            for publisher in self._publishers.values():
                publisher.wait_for_all_acked(Duration(seconds=DELIVERY))
        except (ShakeError, OSError, RuntimeError) as error:
            self._error = str(error)
        self.frame.stop()

    def _pass(self) -> int:
        """Play the recording once; returns the number of messages."""
        before = self.frame.diagnostics.cycles
        for message, deadline in self._timed():
            if not self._wait(deadline):
                break
            self._publish(message)
            self.frame.diagnostics.cycles += 1
        return self.frame.diagnostics.cycles - before

    def _timed(self) -> Iterator[tuple[Message | None, int]]:
        """Messages and the instants [ns, monotonic] at which they are due; None means a tick of /clock."""
        begin = time.monotonic_ns()
        offset = round(self._own.start_offset * SECOND)
        first = next_clock = None
        period = round(SECOND / self._own.clock_rate) if self._own.clock_rate > 0 else 0
        for message in self._bag.messages(list(self._publishers)):
            if first is None:
                first = next_clock = message.received + offset
            if message.received < first:
                continue
            while period and next_clock is not None and next_clock <= message.received:
                self._now = next_clock
                yield None, begin + round((next_clock - first) / self._own.speed)
                next_clock += period
            self._now = message.received
            yield message, begin + round((message.received - first) / self._own.speed)

    def _wait(self, deadline: int) -> bool:
        """Sleep until the deadline; False where the node is to stop."""
        while not self._stopping.is_set():
            left = (deadline - time.monotonic_ns()) / SECOND
            if left <= 0:
                self.frame.diagnostics.lateness(round(-left * SECOND))
                return True
            time.sleep(min(left, LONGEST_SLEEP))
        return False

    def _publish(self, message: Message | None) -> None:
        if message is None:
            if self._clock is not None:
                self._clock.send(self._now)
            return
        insist(self._publishers[message.topic].publish, message.data, self._stopping.is_set, message.topic)


build = Player
