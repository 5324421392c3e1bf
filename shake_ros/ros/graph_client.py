"""What looks at a graph and asks it, beside its nodes: their reports, parameters and services."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from shake_ros.quantities import Parameters, ShakeError
from shake_ros.ros.diagnostics import ERROR, LEVELS
from shake_ros.ros.interface import DIAGNOSTICS, ENABLE, SERVICES, VALVE_COMMAND

TABLES = ("plant", "hardware_bridge")
EVENTS = ("interlock", "fault", "release")  # parts of a node that report what has just happened
POLL = 0.05  # [s]
ANSWER = 120.0  # a node that compiles what it is given answers within [s]
SILENT = 15.0  # a node that has not reported for so long is lost [s]
P = TypeVar("P", bound=Parameters)


@dataclass(frozen=True)
class Report:
    """What /diagnostics says of a node or of a part of it."""

    node: str  # full name, without the first slash
    part: str  # its executable, or one of EVENTS
    # level, message: as published
    level: int
    message: str
    values: dict[str, str]  # by key
    heard: float = field(default_factory=time.monotonic)  # when it arrived, on the monotonic clock [s]


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
        while not (result := found()) and (left := deadline - time.monotonic()) > 0.0:
            self.look(min(POLL, left))
        return result

    def spin(self, seconds: float) -> None:
        """Serve what comes for so long."""
        self.until(lambda: False, seconds)

    def answer(self, future: Any, of: str, timeout: float) -> Any:
        """The result of a call; ShakeError where none comes within `timeout` [s]."""
        if not self.until(future.done, timeout):
            raise ShakeError(f"no answer from {of} within {timeout:g} s")
        return future.result()

    def close(self) -> None:
        """Leave the graph; an executor that outlives its context complains when it is collected."""
        self._executor.shutdown()
        self.node.destroy_node()


class LiveGraph(GraphClient):
    """A node of one's own beside the graph of a namespace, which hears what its nodes report.

    Attributes
    ----------
    reports : executable, and full name without the first slash → newest report.
    trips : words of what the interlock has acted on since this was made.
    services : clients of the interlock's services, by name.
    """

    def __init__(self, context: Context, namespace: str) -> None:
        super().__init__(context, "_shake_live", namespace)
        self.reports: dict[str, Report] = {}
        self.trips: list[str] = []
        self.services: dict[str, Any] = {
            name: self.node.create_client(service.type, service.name) for name, service in SERVICES.items()
        }
        self._clients: dict[str, AsyncParameterClient] = {}
        self.node.create_subscription(DIAGNOSTICS.type, DIAGNOSTICS.name, self._on_report, DIAGNOSTICS.qos(False))

    def _on_report(self, message: DiagnosticArray) -> None:
        for report in reports_in(message, self.space):
            if report.part == "interlock" and report.level == ERROR:
                self.trips.append(report.message)
            elif report.part not in EVENTS:
                self.reports[report.part] = self.reports[report.node] = report

    @property
    def table(self) -> Report | None:
        """Newest report of the table, simulated or real; None before the first."""
        return next((self.reports[name] for name in TABLES if name in self.reports), None)

    def of_table(self, key: str) -> str:
        """A value as the table last reported it; empty before."""
        return self.table.values.get(key, "") if self.table else ""

    def report(self, name: str) -> Report:
        """The newest report of a node, waited for if the last one is old; ShakeError where it is silent."""
        if not self.until(lambda: time.monotonic() - self.reports[name].heard < SILENT, SILENT):
            found = self.reports[name]
            raise ShakeError(f"{found.node} has been silent for {SILENT:g} s; its last message was: {found.message}")
        return self.reports[name]

    def next_report(self, name: str) -> Report:
        """The first report of a node from now on."""
        before = self.reports.get(name)
        if not self.until(lambda: self.reports.get(name) is not before, SILENT) and before is None:
            raise ShakeError(f"{name} has not reported for {SILENT:g} s")
        return self.report(name)

    @property
    def commanders(self) -> int:
        """How many nodes publish commands."""
        return self.node.count_publishers(self.node.resolve_topic_name(VALVE_COMMAND.name))

    def get(self, executable: str, *names: str) -> list[Any]:
        """Values of parameters of a node."""
        result = self.answer(self._client(executable).get_parameters(list(names)), executable, ANSWER)
        return [parameter_value_to_python(value) for value in result.values]

    def get_names(self, executable: str) -> list[str]:
        """Names of the parameters of a node."""
        return list(self.answer(self._client(executable).list_parameters(), executable, ANSWER).result.names)

    def set(self, executable: str, values: Mapping[str, Any]) -> None:
        """Set parameters of a node, all or none; ShakeError with the reason where it refuses."""
        wanted = [Parameter(name, value=value) for name, value in values.items()]
        result = self.answer(self._client(executable).set_parameters_atomically(wanted), executable, ANSWER).result
        if not result.successful:
            raise ShakeError(f"{self.reports[executable].node}: {result.reason or 'refused'}")

    def enable(self, on: bool) -> None:
        """Ask the table to start or to stop in order; ShakeError where it refuses."""
        request = ENABLE.type.Request(data=on)
        answer = self.answer(self.services[ENABLE.name].call_async(request), ENABLE.name, ANSWER)
        if not answer.success:
            raise ShakeError(f"the table refuses: {answer.message}")

    def values(self, executable: str, given: P) -> P:
        """Parameters as a node has them now, in place of those `given`."""
        names = [f.name for f in fields(given)]
        return given.replace(**dict(zip(names, self.get(executable, *names), strict=True)))

    def _client(self, executable: str) -> AsyncParameterClient:
        name = f"/{self.reports[executable].node}"
        client = self._clients.setdefault(name, AsyncParameterClient(self.node, name))
        if not self.until(client.services_are_ready, SILENT):
            raise ShakeError(f"{name}: its parameters cannot be reached")
        return client
