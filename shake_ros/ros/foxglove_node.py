"""Node `foxglove`: a thinned copy of the topics for Foxglove, over a web socket of this machine.

Messages pass as they came, with the definition of their type, so that config/layouts/foxglove.json shows them and a
recording alike. Of each topic at most `rate` messages a second pass; all of them stay in the recording.
"""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

import foxglove
from foxglove.websocket import WebSocketServer

from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.recordings.bags.writer import definition_of
from shake_ros.ros import interface
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.diagnostics import OK
from shake_ros.ros.frame import Behaviour, Frame

BACKLOG = 256  # messages kept for a client that reads slowly; the oldest are dropped


@dataclass(frozen=True)
class FoxgloveParameters(Parameters):
    """The node's own settings."""

    host: str = choice("address to listen on, of this machine alone")
    port: int = quantity("-", "port to listen on, 0 for a free one", low=0, high=65535)
    passed_rate: float = quantity("Hz", "most messages of a topic that pass", low=0.1, high=1000.0)


class Thinned:
    """One topic on its way to the clients: a message passes when its turn of the wall clock has come."""

    def __init__(self, frame: Frame, topic: interface.Topic, period: int, context: foxglove.Context) -> None:
        self.passed = self._next = 0
        self._frame, self._period = frame, period if topic.sampled else 0
        kind = interface.type_name(topic.type)
        schema = foxglove.Schema(name=kind, encoding="ros2msg", data=definition_of(kind)[0].encode())
        name = frame.resolved(topic.name)
        self.channel = foxglove.Channel(name, schema=schema, message_encoding="cdr", context=context)
        profile = interface.REALTIME_QOS if topic.sampled else interface.EVENT_QOS
        frame.subscription(topic, self.arrived, profile=interface.copied(profile))

    def arrived(self, data: bytes) -> None:
        """A message, serialised."""
        now = self._frame.node.get_clock().now().nanoseconds
        if now >= self._next:
            self._next = max(self._next + self._period, now)
            self.passed += 1
            self.channel.log(data, log_time=now)


class FoxgloveServer(Behaviour):
    """Subscribes to every topic of the interface and serves what passes."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self._own = frame.settings(FoxgloveParameters).value
        if not _local(self._own.host):
            raise ShakeError(f"parameter host: {self._own.host} is not this machine alone; from afar use ssh -L")
        self._context = foxglove.Context()
        self._server: WebSocketServer | None = None
        period = round(SECOND / self._own.passed_rate)
        self.topics = [Thinned(frame, topic, period, self._context) for topic in interface.TOPICS.values()]
        frame.diagnostics.condition = lambda: (OK, f"{sum(t.passed for t in self.topics)} messages passed")
        frame.diagnostics.values["passed"] = lambda: sum(t.passed for t in self.topics)

    def start(self) -> None:
        """Listen."""
        try:
            self._server = foxglove.start_server(
                name="shake_ros",
                host=self._own.host,
                port=self._own.port,
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except (OSError, RuntimeError) as error:
            raise ShakeError(f"{self._own.host}:{self._own.port}: cannot listen ({error})") from None
        self.frame.node.get_logger().info(f"Foxglove: open ws://{self._own.host}:{self._server.port}")

    def finish(self) -> None:
        """Close the connections."""
        if self._server is not None:
            self._server.stop()


def _local(host: str) -> bool:
    """Whether an address is of this machine alone.

    >>> _local("127.0.0.1"), _local("::1"), _local("localhost"), _local("0.0.0.0")
    (True, True, True, False)
    """
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


build = FoxgloveServer
