"""All sampled topics for the page, taken in batches: no callback a message.

A message that passes through an executor's callback costs 40 µs, 8000 messages a second a third of a core; taken and
decoded in batches they cost a tenth of that.
"""

from __future__ import annotations

from typing import Any

from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from shake_ros.data.recordings.cdr import columns
from shake_ros.data.recordings.series import SIGNALS
from shake_ros.page.samples import TOPICS as SHOWN
from shake_ros.page.samples import SampleStore
from shake_ros.ros.interface import TOPICS

# Keeps the newest: in real time no writer ever waits for it. In lock-step, where all waits for all, a page whose
# process stands still holds the loop up until it is forgotten (3 s), and costs no sample.
TAP_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=2000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)


class SampleTap:
    """Readers on a node of their own that no executor serves.

    Parameters
    ----------
    context, namespace : of the page's node. store : where samples go.
    """

    def __init__(self, context: Context, namespace: str, store: SampleStore) -> None:
        self.node = Node(
            "_page_samples", namespace=namespace, context=context, start_parameter_services=False, enable_rosout=False
        )
        self._store = store
        self._readers = [
            (name, self.node.create_subscription(TOPICS[name].type, name, lambda _: None, TAP_QOS, raw=True))
            for name in SHOWN
        ]

    def take(self) -> None:
        """Take all that has come."""
        for name, reader in self._readers:
            messages = []
            handle: Any = reader.handle
            with handle:
                while (taken := handle.take_message(reader.msg_type, True)) is not None:
                    messages.append(taken[0])
            if messages:
                signal = SIGNALS[name]
                stamps, values, sources = columns(messages, signal.type, signal.choose, len(signal.paths))
                own = sources >= 0  # messages of other joints on a shared topic are not the table's
                self._store.add(name, stamps[own], values[own])

    def close(self) -> None:
        """Leave the graph."""
        self.node.destroy_node()
