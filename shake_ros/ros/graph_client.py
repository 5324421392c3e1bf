"""What looks at a graph and asks it, beside its nodes; and how `lab` does: who reports, the stage, an orderly stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from shake_ros.core.quantities import ShakeError
from shake_ros.core.safety.stages import OFF, STAGES
from shake_ros.ros.diagnostics import ERROR, LEVELS, NO_ANSWER
from shake_ros.ros.exclusive_writer import ExclusiveWriter
from shake_ros.ros.interface import DIAGNOSTICS, ENABLE, ESTIMATE, JOINT_STATES, REFERENCE, VALVE_COMMAND

TABLES = ("plant", "hardware_bridge")
POLL = 0.05  # [s]
SLOW = 5.0  # an orderly stop that takes longer is explained [s]
LOOP_TOPICS = (JOINT_STATES, REFERENCE, ESTIMATE, VALVE_COMMAND)


class Report(NamedTuple):
    """What /diagnostics says of a node or of a part of it.

    node : full name, without the first slash.
    part : its executable; "interlock" or "fault" for what has just happened.
    level, text : of the message.
    values : by key.
    """

    node: str
    part: str
    level: int
    text: str
    values: dict[str, str]


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    """What a program reads of a status, by key."""
    return {one.key: one.value for one in status.values}


def reports_in(message: DiagnosticArray, space: str) -> Iterator[Report]:
    """The reports of the nodes of a namespace, which is given without its first slash."""
    for status in message.status:
        node, _, part = status.name.partition(": ")
        if node.rpartition("/")[0] == space:
            yield Report(node, part, LEVELS.index(status.level), status.message, values_of(status))


class GraphClient:
    """A node of one's own beside a graph, with an executor that works when it is asked to.

    Parameters
    ----------
    name : of the node.
    namespace : of the graph; the root where not given.

    Attributes
    ----------
    node : of rclpy.
    space : its namespace without the first slash.
    """

    def __init__(self, context: Context, name: str, namespace: str | None = None) -> None:
        self.node = Node(
            name, namespace=namespace, context=context, start_parameter_services=False, enable_rosout=False
        )
        self.space = self.node.get_namespace().strip("/")
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)

    def look(self, timeout: float = POLL) -> None:
        """Serve one callback, waiting for it for at most `timeout` [s]."""
        self._executor.spin_once(timeout_sec=timeout)

    def until(self, found: Callable[[], Any], timeout: float) -> Any:
        """What `found` finds as soon as it is something; what it finds after `timeout` [s] else."""
        deadline = time.monotonic() + timeout
        while not (result := found()) and time.monotonic() < deadline:
            self.look()
        return result

    def answer(self, future: Any, of: str, timeout: float) -> Any:
        """The result of a call; ShakeError where none comes within `timeout` [s]."""
        if not self.until(future.done, timeout):
            raise ShakeError(f"no answer from {of} within {timeout:g} s")
        return future.result()

    def close(self) -> None:
        """Leave the graph; an executor that outlives its context complains when it is collected."""
        self._executor.shutdown()
        self.node.destroy_node()


class LabWatch(GraphClient):
    """The eyes of `lab`.

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
        super().__init__(context, "_shake_lab", namespace)
        self.heard: set[str] = set()
        self.stage = self.cycles = self.missing = ""
        self.tripped: set[str] = set()
        self.acts = False
        self.trips: list[str] = []
        self._gain = ""
        self.node.create_subscription(DIAGNOSTICS.type, DIAGNOSTICS.name, self._report, DIAGNOSTICS.qos(lockstep))
        self._enable: Any = self.node.create_client(ENABLE.type, ENABLE.name)

    def _report(self, message: DiagnosticArray) -> None:
        for report in reports_in(message, self.space):
            self.heard.add(report.node.rpartition("/")[2])
            if report.part == "interlock" and report.level == ERROR:
                self.trips.append(report.text)
            if report.part in TABLES:
                values = report.values
                self.missing = report.text if report.text.startswith(NO_ANSWER) else ""
                self.stage, self.cycles = values.get("stage", self.stage), values.get("cycles", self.cycles)
                self.tripped = {one.partition(":")[0] for one in values.get("trips", "").split()}
                gain, self._gain = self._gain, values.get("span", "")
                self.acts = values.get("passes") == "True" and gain == self._gain and float(gain) > 0.0

    def spin(self, seconds: float) -> None:
        """Serve what comes for so long."""
        end = time.monotonic() + seconds
        while True:
            self.look(max(0.0, end - time.monotonic()))
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
            self.spin(POLL)
            if slowly and self.cycles != cycles:
                since, cycles = time.monotonic(), self.cycles
                if not reported and since - begun > SLOW:
                    reported = True
                    slowly()
        return self.stage in ("", STAGES[OFF])
