"""Nodes described: `NAME --help` of one that nobody can see, and the parameters of the other nodes of a graph."""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from shake_ros.entry_points import NODES
from shake_ros.page.desk import Answer
from shake_ros.quantities import KINDS, ShakeError
from shake_ros.ros.frame import Frame
from shake_ros.ros.interface import type_name
from shake_ros.ros.loop import DISCOVERY_RANGE, ros_context
from shake_ros.ros.parameters import OWN_OVERRIDES

OUT_OF_SIGHT = "/_help"  # no topic of a graph that runs gets another writer
UNBOUNDED = 1e300  # a bound beyond stands for none


def bounds(described: Any) -> tuple[float | None, float | None]:
    """The least and the largest value of a parameter, None where there is none."""
    low = high = None
    for one in (*described.floating_point_range, *described.integer_range):
        low = one.from_value if one.from_value > -UNBOUNDED else None
        high = one.to_value if one.to_value < UNBOUNDED else None
    return low, high


def parameter_lines(frame: Frame) -> list[str]:
    """Name, default, range and meaning of each; a star marks what may change while the node runs."""
    lines = []
    for name in frame.node._parameters:
        if name.startswith(OWN_OVERRIDES):
            continue
        described, value = frame.node.describe_parameter(name), frame.node.get_parameter(name).value
        low, high = bounds(described)
        shown = str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else value
        star = " " if described.read_only else "*"
        limits = f" ({described.additional_constraints})" if described.additional_constraints else ""
        if low is not None:
            limits = f" ({low:g} … {high:g})" if high is not None else f" (from {low:g})"
        lines.append(f" {star}{name} = {shown if shown != '' else repr('')}\n      {described.description}{limits}")
    return lines


def topic_lines(frame: Frame) -> list[str]:
    """What the node writes, reads and answers to."""
    node, space = frame.node, frame.node.get_namespace().rstrip("/") + "/"
    lines = []
    for title, found in (
        ("writes", {one.topic_name: one.msg_type for one in node.publishers}),
        ("reads", {one.topic_name: one.msg_type for one in node.subscriptions}),
        ("answers to", {one.service_name: one.srv_type for one in node.services}),
    ):
        names = {name.removeprefix(space): kind for name, kind in found.items()}
        own = [
            f"  {name} [{type_name(kind)}]"
            for name, kind in sorted(names.items())
            if not kind.__module__.startswith(("rcl_interfaces.", "type_description_interfaces."))
        ]
        lines += [f"{title}:", *own] if own else []
    return lines


def text(build: Callable[[Frame], Any], name: str) -> str:
    """The help of a node as config/ has it; it is built out of sight of all others, in a folder that is thrown away."""
    os.environ[DISCOVERY_RANGE] = "OFF"
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder, ros_context([]) as context:
        os.chdir(folder)
        try:
            frame = Frame(name, context, ["--ros-args", "-r", f"__ns:={OUT_OF_SIGHT}"])
            frame.node.get_logger().set_level(LoggingSeverity.FATAL)
            with contextlib.suppress(ShakeError):  # the player misses its recording
                build(frame).finish()
            lines = [
                f"{name}: {NODES[name].line}",
                "",
                f"./shake {name} --ros-args -p NAME:=VALUE …, ros2 run shake_ros {name} --ros-args -p NAME:=VALUE …",
                "",
                "parameters with their defaults (* may change while the node runs):",
                *parameter_lines(frame),
                "",
                *topic_lines(frame),
            ]
            frame.close()
        finally:
            os.chdir(here)
    return "\n".join(lines)


AGAIN = 0.4  # a node is not asked more often [s]


def parameter_entry(described: Any, value: Any) -> dict[str, Any]:
    """One parameter for the page: name, value, meaning, unit, bounds, choices, live."""
    meaning, _, unit = described.description.rpartition(" [")
    if not meaning or not described.description.endswith("]"):
        meaning, unit = described.description, ""
    low, high = bounds(described)
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
    """Keeps what the nodes say of their parameters; works in the thread of the node's executor."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._space = node.get_namespace().rstrip("/")
        self._clients: dict[str, AsyncParameterClient] = {}
        self._wanted: dict[str, float] = {}
        self.nodes: dict[str, list[dict[str, Any]]] = {}  # executable name → list of parameters, replaced whole
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
                parameter_entry(described, parameter_value_to_python(value))
                for described, value in zip(descriptors, found.values, strict=True)
            ]

    def value(self, node: str, name: str) -> Any:
        """The last value received; None where there is none."""
        return next((one["value"] for one in self.nodes.get(node, []) if one["name"] == name), None)

    def set(self, node: str, name: str, value: Any, done: Future[Answer]) -> None:
        """Set a parameter and say how that ended."""
        known = next((one for one in self.nodes.get(node, []) if one["name"] == name), None)
        if known is None or node not in self._clients:
            done.set_result(Answer(False, f"{node} has no parameter {str(name)[:60]}"))
            return
        try:
            exact = KINDS[known["kind"]](value)
            if isinstance(value, bool) != (known["kind"] == "bool"):
                raise ValueError
        except (ValueError, TypeError, OverflowError, KeyError):
            done.set_result(Answer(False, f"{name} = {str(value)[:60]} is not of type {known['kind']}"))
            return

        def answered(result: Any) -> None:
            self._wanted[node] = time.monotonic() + 0.05
            one = result.results[0]
            text = f"{name} = {exact}" if one.successful else one.reason or f"{name}: refused"
            if not done.done():
                done.set_result(Answer(bool(one.successful), text))

        request = [Parameter(name, value=exact)]
        self._clients[node].set_parameters(request, callback=self._then(answered))
