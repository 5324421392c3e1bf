"""A running graph from outside: what its nodes report, their parameters, the services of its interlock."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from shake_ros.core.quantities import ShakeError
from shake_ros.ros.diagnostics import ERROR, LEVELS
from shake_ros.ros.interface import DIAGNOSTICS, ENABLE, VALVE_COMMAND

POLL = 0.05  # [s]
ANSWER = 120.0  # a node that compiles what it is given answers within [s]
SILENT = 15.0  # a node that has not reported for so long is lost [s]


@dataclass
class NodeReport:
    """The newest report of a node: its full name, words, values; when it was heard and how many came [s], [-]."""

    node: str
    message: str = ""
    values: dict[str, str] = field(default_factory=dict)
    heard: float = 0.0
    count: int = 0


class LiveGraph:
    """A node of one's own beside the graph of a namespace.

    Attributes
    ----------
    reports : executable → newest report. nodes : the same by full name, where several have one executable.
    trips : words of what the interlock has acted on since this was made.
    """

    def __init__(self, context: Context, namespace: str) -> None:
        self.node = Node(
            "_shake_live", namespace=namespace, context=context, start_parameter_services=False, enable_rosout=False
        )
        self.reports: dict[str, NodeReport] = {}
        self.nodes: dict[str, NodeReport] = {}
        self.trips: list[str] = []
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self._clients: dict[str, AsyncParameterClient] = {}
        self._space = self.node.get_namespace().strip("/")
        self._enable: Any = self.node.create_client(ENABLE.type, ENABLE.name)
        self.node.create_subscription(DIAGNOSTICS.type, DIAGNOSTICS.name, self._on_report, DIAGNOSTICS.qos(False))

    def _on_report(self, message: DiagnosticArray) -> None:
        for status in message.status:
            node, _, part = status.name.partition(": ")
            if node.rpartition("/")[0] != self._space:
                continue
            if part == "interlock":
                self.trips += [status.message] if LEVELS.index(status.level) == ERROR else []
            elif part != "fault":
                report = self.reports[part] = self.nodes.setdefault(node, NodeReport(node))
                report.message = status.message
                report.values = {one.key: one.value for one in status.values}
                report.heard, report.count = time.monotonic(), report.count + 1

    def until(self, found: Callable[[], Any], patience: float) -> Any:
        """What `found` finds as soon as it is something; what it finds after `patience` [s] else."""
        deadline = time.monotonic() + patience
        while not (result := found()) and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=POLL)
        return result

    def report(self, executable: str) -> NodeReport:
        """The newest report of a node, waited for where nothing was heard for long; ShakeError where it is silent."""
        if not self.until(lambda: time.monotonic() - self.reports[executable].heard < SILENT, SILENT):
            found = self.reports[executable]
            raise ShakeError(f"{found.node} has been silent for {SILENT:g} s; its last word was: {found.message}")
        return self.reports[executable]

    def next_report(self, executable: str) -> NodeReport:
        """The first report of a node from now on."""
        before = self.reports[executable].count
        self.until(lambda: self.reports[executable].count > before, SILENT)
        return self.report(executable)

    @property
    def commanders(self) -> int:
        """How many nodes publish commands."""
        return self.node.count_publishers(self.node.resolve_topic_name(VALVE_COMMAND.name))

    def get(self, executable: str, *names: str) -> list[Any]:
        """Values of parameters of a node."""
        result = self._answer(self._client(executable).get_parameters(list(names)), executable)
        return [parameter_value_to_python(value) for value in result.values]

    def get_names(self, executable: str) -> list[str]:
        """Names of the parameters of a node."""
        return list(self._answer(self._client(executable).list_parameters(), executable).result.names)

    def set(self, executable: str, values: Mapping[str, Any]) -> None:
        """Set parameters of a node, all or none; ShakeError with the reason where it refuses."""
        wanted = [Parameter(name, value=value) for name, value in values.items()]
        result = self._answer(self._client(executable).set_parameters_atomically(wanted), executable).result
        if not result.successful:
            raise ShakeError(f"{self.reports[executable].node}: {result.reason or 'refused'}")

    def enable(self, on: bool) -> None:
        """Ask the table to start or to stop in order; ShakeError where it refuses."""
        answer = self._answer(self._enable.call_async(ENABLE.type.Request(data=on)), "enable")
        if not answer.success:
            raise ShakeError(f"the table refuses: {answer.message}")

    def _client(self, executable: str) -> AsyncParameterClient:
        name = f"/{self.reports[executable].node}"
        client = self._clients.setdefault(name, AsyncParameterClient(self.node, name))
        if not self.until(client.services_are_ready, SILENT):
            raise ShakeError(f"{name}: its parameters cannot be reached")
        return client

    def _answer(self, future: Any, of: str) -> Any:
        if not self.until(future.done, ANSWER):
            raise ShakeError(f"{of}: no answer within {ANSWER:g} s")
        return future.result()

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self.node.destroy_node()
