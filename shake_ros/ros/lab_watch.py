"""What `lab` sees and asks of its graph over ROS: who reports, at which stage the table is, an orderly stop."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from shake_ros.core.safety.stages import OFF, STAGES
from shake_ros.ros.diagnostics import ERROR, LEVELS, NO_ANSWER
from shake_ros.ros.exclusive_writer import ExclusiveWriter
from shake_ros.ros.interface import DIAGNOSTICS, ENABLE, ESTIMATE, JOINT_STATES, REFERENCE, VALVE_COMMAND

TABLES = ("plant", "hardware_bridge")
SLOW = 5.0  # an orderly stop that takes longer is explained [s]
LOOP_TOPICS = (JOINT_STATES, REFERENCE, ESTIMATE, VALVE_COMMAND)


class LabWatch:
    """A node of one's own beside the graph.

    Attributes
    ----------
    heard : executables that have reported on /diagnostics since they were last forgotten.
    stage : of the table as last reported; empty before.
    cycles : samples that the table has taken, as last reported; empty before.
    missing : what the table's node says of a target computer that does not answer; empty where none is missed.
    tripped : causes that the interlock has acted on since its node started.
    acts : whether commands act, with a master gain that rises no more.
    trips : words of what the interlock has acted on since they were last taken.
    """

    def __init__(self, context: Context, namespace: str, lockstep: bool) -> None:
        self.node = Node("_shake_lab", namespace=namespace, context=context, start_parameter_services=False)
        self.heard: set[str] = set()
        self.stage = self.cycles = self.missing = ""
        self.tripped: set[str] = set()
        self.acts = False
        self.trips: list[str] = []
        self._gain = ""
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
            if part == "interlock" and LEVELS.index(status.level) == ERROR:
                self.trips.append(status.message)
            if part in TABLES:
                values = {one.key: one.value for one in status.values}
                self.missing = status.message if status.message.startswith(NO_ANSWER) else ""
                self.stage, self.cycles = values.get("stage", self.stage), values.get("cycles", self.cycles)
                self.tripped = {one.partition(":")[0] for one in values.get("trips", "").split()}
                gain, self._gain = self._gain, values.get("span", "")
                self.acts = values.get("passes") == "True" and gain == self._gain and float(gain) > 0.0

    def spin(self, seconds: float) -> None:
        """Serve what comes for so long."""
        end = time.monotonic() + seconds
        while True:
            self._executor.spin_once(timeout_sec=max(0.0, end - time.monotonic()))
            if time.monotonic() >= end:
                return

    def refuse_a_second_graph(self, domain: int) -> None:
        """Raise ShakeError where a running node of this machine has a topic of the loop."""
        exclusive = ExclusiveWriter(domain)
        try:
            for topic in LOOP_TOPICS:
                exclusive.take("topic", str(self.node.resolve_topic_name(topic.name)))
        finally:
            exclusive.give_up()

    def stop_in_order(self, timeout: float, slowly: Callable[[], None] | None = None) -> bool:
        """A hold, then the pressure off; whether the table said so within `timeout` [s].

        With `slowly` (lock-step, which a busy machine runs at a fraction of real time) the timeout begins anew with
        every sample that the table takes; it is called once, where the stop takes longer than that of a quick table.
        """
        begun = since = time.monotonic()
        asked = reported = False
        cycles = self.cycles
        while self.stage not in ("", STAGES[OFF]) and time.monotonic() - since < timeout:
            if not asked and self._enable.service_is_ready():
                self._enable.call_async(ENABLE.type.Request(data=False))
                asked = True
            self.spin(0.05)
            if slowly and self.cycles != cycles:
                since, cycles = time.monotonic(), self.cycles
                if not reported and since - begun > SLOW:
                    reported = True
                    slowly()
        return self.stage in ("", STAGES[OFF])

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self.node.destroy_node()
