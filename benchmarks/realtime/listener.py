"""Hears everything that a graph says, in a thread of its own, for the scripts beside it."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.task import Future

from shake_ros.ros.interface import DIAGNOSTICS, NAMESPACE, PREDICTED_IMU, PREDICTED_JOINT_STATES, TOPICS, Topic
from shake_ros.ros.loop import make_executor, ros_context

PREDICTED = (PREDICTED_JOINT_STATES, PREDICTED_IMU)  # of the twin, which is beside the loop
SAMPLED = tuple(topic.name for topic in TOPICS.values() if topic.sampled and topic not in PREDICTED)


class Listener:
    """Collects the serialised messages of topics in order of arrival, in a `with` block.

    Parameters
    ----------
    topics : names from the interface.
    lockstep : quality of service to ask for.
    namespace, domain_id : of the graph.
    """

    def __init__(
        self, topics: Sequence[str] = SAMPLED, *, lockstep: bool, domain_id: int, namespace: str = NAMESPACE
    ) -> None:
        self.topics = [TOPICS[name] for name in topics]
        self.raw: dict[str, list[bytes]] = {name: [] for name in topics}
        self.arrivals: dict[str, list[int]] = {name: [] for name in topics}
        self._lockstep = lockstep
        self._domain_id = domain_id
        self._namespace = namespace
        self._done: Future[None] = Future()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)

    def __enter__(self) -> Listener:
        self._thread.start()
        self._ready.wait(10.0)
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set_result(None)
        self._thread.join(10.0)

    def _listen(self) -> None:
        with ros_context([], domain_id=self._domain_id) as context:
            node = Node("listener", namespace=self._namespace, context=context, start_parameter_services=False)
            executor = make_executor(context)
            for topic in self.topics:
                self._subscribe(node, topic)
            executor.add_node(node)
            self._ready.set()
            while not self._done.done():
                executor.spin_until_future_complete(self._done, timeout_sec=0.05)
            executor.remove_node(node)
            node.destroy_node()
            executor.shutdown()

    def _subscribe(self, node: Node, topic: Topic) -> None:
        raw, arrivals = self.raw[topic.name], self.arrivals[topic.name]

        def heard(data: bytes) -> None:
            raw.append(data)
            arrivals.append(time.time_ns())

        node.create_subscription(topic.type, topic.name, heard, topic.qos(self._lockstep), raw=True)

    def messages(self, name: str) -> list[Any]:
        """Decoded messages of a topic; the bytes are not comparable, since padding is undefined."""
        return [deserialize_message(data, TOPICS[name].type) for data in self.raw[name]]

    def wait_for(self, counts: dict[str, int], timeout: float) -> None:
        """Return when each topic has given at least so many messages; AssertionError with what came, else."""
        deadline = time.monotonic() + timeout
        while any(len(self.raw[name]) < count for name, count in counts.items()):
            if time.monotonic() > deadline:
                came = {name: len(self.raw[name]) for name in counts}
                raise AssertionError(f"after {timeout:g} s {came} of {counts} messages")
            time.sleep(0.01)

    def status(self, node: str) -> dict[str, str]:
        """Newest /diagnostics of a node: its values, with `level` and `message`; empty before the first."""
        for message in reversed(self.messages(DIAGNOSTICS.name)):
            for status in message.status:
                if status.name.endswith(f": {node}"):
                    values = {item.key: item.value for item in status.values}
                    return {**values, "level": str(int.from_bytes(status.level, "little")), "message": status.message}
        return {}

    def wait_for_status(self, node: str, text: str, timeout: float) -> dict[str, str]:
        """The first status of a node whose message holds `text`; AssertionError with the newest, else."""
        deadline = time.monotonic() + timeout
        while text not in (status := self.status(node)).get("message", ""):
            if time.monotonic() > deadline:
                raise AssertionError(f"/diagnostics of {node} does not say '{text}' after {timeout:g} s: {status}")
            time.sleep(0.05)
        return status
