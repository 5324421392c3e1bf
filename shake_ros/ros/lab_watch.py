"""What `lab` sees and asks of its graph over ROS: who reports, at which stage the table is, an orderly stop."""

from __future__ import annotations

import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from shake_ros.core.safety.stages import OFF, STAGES
from shake_ros.ros.claims import Claims
from shake_ros.ros.interface import DIAGNOSTICS, ENABLE, ESTIMATE, JOINT_STATES, REFERENCE, VALVE_COMMAND

TABLES = ("plant", "hardware_bridge")
LOOP_TOPICS = (JOINT_STATES, REFERENCE, ESTIMATE, VALVE_COMMAND)


class LabWatch:
    """A node of one's own beside the graph.

    Attributes
    ----------
    heard : executables that have reported on /diagnostics since they were last forgotten.
    stage : of the table as last reported; empty before.
    """

    def __init__(self, context: Context, namespace: str, lockstep: bool) -> None:
        self.node = Node("_shake_lab", namespace=namespace, context=context, start_parameter_services=False)
        self.heard: set[str] = set()
        self.stage = ""
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self.node.create_subscription(DIAGNOSTICS.type, DIAGNOSTICS.name, self._report, DIAGNOSTICS.qos(lockstep))
        self._enable: Any = self.node.create_client(ENABLE.type, ENABLE.name)
        self._space = self.node.get_namespace().strip("/")

    def _report(self, message: DiagnosticArray) -> None:
        for status in message.status:
            node, _, part = status.name.partition(": ")
            if not node.startswith(f"{self._space}/"):
                continue
            self.heard.add(node.rpartition("/")[2])
            if part in TABLES:
                self.stage = next((one.value for one in status.values if one.key == "stage"), self.stage)

    def spin(self, seconds: float) -> None:
        """Serve what comes for so long."""
        end = time.monotonic() + seconds
        while True:
            self._executor.spin_once(timeout_sec=max(0.0, end - time.monotonic()))
            if time.monotonic() >= end:
                return

    def refuse_a_second_graph(self, domain: int) -> None:
        """Raise ShakeError where a running node of this machine has a topic of the loop."""
        claims = Claims(domain)
        try:
            for topic in LOOP_TOPICS:
                claims.take("topic", str(self.node.resolve_topic_name(topic.name)))
        finally:
            claims.give_up()

    def stop_in_order(self, patience: float) -> bool:
        """A hold, then the pressure off; whether the table said so within `patience` [s]."""
        if self.stage in ("", STAGES[OFF]):
            return True
        if not self._enable.service_is_ready():
            return False
        request = ENABLE.type.Request(data=False)
        self._enable.call_async(request)
        deadline = time.monotonic() + patience
        while self.stage != STAGES[OFF] and time.monotonic() < deadline:
            self.spin(0.05)
        return self.stage == STAGES[OFF]

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self.node.destroy_node()
