"""The parameters of the other nodes of a graph, as their descriptors tell them; set with the reason of a refusal."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from rcl_interfaces.msg import ParameterEvent, ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from shake_ros.page.desk import Answer
from shake_ros.ros.node_help import UNBOUNDED
from shake_ros.ros.parameters import OWN_OVERRIDES

AGAIN = 0.4  # a node is not asked more often [s]
TYPES = {
    ParameterType.PARAMETER_BOOL: (Parameter.Type.BOOL, bool),
    ParameterType.PARAMETER_INTEGER: (Parameter.Type.INTEGER, int),
    ParameterType.PARAMETER_DOUBLE: (Parameter.Type.DOUBLE, float),
    ParameterType.PARAMETER_STRING: (Parameter.Type.STRING, str),
}


def told(described: Any, value: Any) -> dict[str, Any]:
    """One parameter for the page: name, value, meaning, unit, bounds, choices, live."""
    meaning, _, unit = described.description.rpartition(" [")
    if not meaning or not described.description.endswith("]"):
        meaning, unit = described.description, ""
    low = high = None
    for one in (*described.floating_point_range, *described.integer_range):
        low = one.from_value if one.from_value > -UNBOUNDED else None
        high = one.to_value if one.to_value < UNBOUNDED else None
    names = described.additional_constraints.removeprefix("one of ").split(", ")
    return {
        "name": described.name,
        "value": value,
        "meaning": meaning,
        "unit": unit.rstrip("]"),
        "low": low,
        "high": high,
        "names": names if described.additional_constraints.startswith("one of ") else [],
        "live": not described.read_only,
        "kind": type(value).__name__,
    }


class RemoteParameters:
    """Keeps what the nodes say of their parameters; works in the thread of the node's executor.

    Attributes
    ----------
    nodes : executable name → list of parameters, replaced whole.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._space = node.get_namespace().rstrip("/")
        self._clients: dict[str, AsyncParameterClient] = {}
        self._wanted: dict[str, float] = {}
        self.nodes: dict[str, list[dict[str, Any]]] = {}
        node.create_subscription(ParameterEvent, "/parameter_events", self._event, 100)

    def _event(self, message: ParameterEvent) -> None:
        space, _, name = message.node.rpartition("/")
        if space == self._space and name in self._clients:
            self._wanted.setdefault(name, time.monotonic() + AGAIN)

    def know(self, name: str) -> None:
        """A node that has been seen for the first time, or again after a restart."""
        self._clients.setdefault(name, AsyncParameterClient(self._node, f"{self._space}/{name}"))
        self._wanted[name] = 0.0

    def serve(self) -> None:
        """Ask the nodes whose parameters may have changed."""
        now = time.monotonic()
        for name in [name for name, due in self._wanted.items() if due <= now]:
            client = self._clients[name]
            if client.services_are_ready():
                del self._wanted[name]
                client.list_parameters(callback=self._then(self._describe, name))

    def _then(self, act: Callable[..., None], *before: Any) -> Callable[[Any], None]:
        def done(future: Any) -> None:
            if future.exception() is None and future.result() is not None:
                act(*before, future.result())

        return done

    def _describe(self, name: str, listed: Any) -> None:
        names = [one for one in listed.result.names if not one.startswith(OWN_OVERRIDES)]
        self._clients[name].describe_parameters(names, callback=self._then(self._get, name, names))

    def _get(self, name: str, names: list[str], described: Any) -> None:
        self._clients[name].get_parameters(names, callback=self._then(self._keep, name, described.descriptors))

    def _keep(self, name: str, descriptors: Any, found: Any) -> None:
        if len(descriptors) == len(found.values):
            self.nodes[name] = [
                told(described, parameter_value_to_python(value))
                for described, value in zip(descriptors, found.values, strict=True)
            ]

    def value(self, node: str, name: str) -> Any:
        """The value last heard; None where there is none."""
        return next((one["value"] for one in self.nodes.get(node, []) if one["name"] == name), None)

    def set(self, node: str, name: str, value: Any, done: Future[Answer]) -> None:
        """Set a parameter and say how that ended."""
        known = next((one for one in self.nodes.get(node, []) if one["name"] == name), None)
        if known is None or node not in self._clients:
            done.set_result(Answer(False, f"{node} has no parameter {str(name)[:60]}"))
            return
        try:
            kind = next(one for one in TYPES.values() if one[1].__name__ == known["kind"])
            exact = kind[1](value)
            if isinstance(value, bool) != (known["kind"] == "bool"):
                raise ValueError
        except (ValueError, TypeError, OverflowError, StopIteration):
            done.set_result(Answer(False, f"{name} = {str(value)[:60]} is not of type {known['kind']}"))
            return

        def answered(result: Any) -> None:
            self._wanted[node] = time.monotonic() + 0.05
            one = result.results[0]
            text = f"{name} = {exact}" if one.successful else one.reason or f"{name}: refused"
            if not done.done():
                done.set_result(Answer(bool(one.successful), text))

        request = [Parameter(name, kind[0], exact)]
        self._clients[node].set_parameters(request, callback=self._then(answered))
