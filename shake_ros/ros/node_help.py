"""`NAME --help` of a node: its parameters, topics and services, read off the node itself while nobody can see it."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable
from typing import Any

from rclpy.impl.logging_severity import LoggingSeverity

from shake_ros.core.quantities import ShakeError
from shake_ros.entry_points import NODES
from shake_ros.ros.frame import Frame
from shake_ros.ros.loop import DISCOVERY_RANGE, ros_context
from shake_ros.ros.parameters import OWN_OVERRIDES

OUT_OF_SIGHT = "/_help"  # no topic of a graph that runs gets another writer
UNBOUNDED = 1e300  # a bound beyond stands for none


def bounds(described: Any) -> str:
    """The range or the names that a parameter may have; empty for any."""
    if described.additional_constraints:
        return str(described.additional_constraints)
    for one in (*described.floating_point_range, *described.integer_range):
        low, high = float(one.from_value), float(one.to_value)
        if low > -UNBOUNDED or high < UNBOUNDED:
            return f"{low:g} … {high:g}" if high < UNBOUNDED else f"from {low:g}"
    return ""


def parameter_lines(frame: Frame) -> list[str]:
    """Name, default, range and meaning of each; a star marks what may change while the node runs."""
    lines = []
    for name in frame.node._parameters:
        if name.startswith(OWN_OVERRIDES):
            continue
        described, value = frame.node.describe_parameter(name), frame.node.get_parameter(name).value
        shown = str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else value
        star = " " if described.read_only else "*"
        limits = f" ({found})" if (found := bounds(described)) else ""
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
            f"  {name} [{kind.__module__.split('.')[0]}/{'srv' if title == 'answers to' else 'msg'}/{kind.__name__}]"
            for name, kind in sorted(names.items())
            if kind.__module__.split(".")[0] not in ("rcl_interfaces", "type_description_interfaces")
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
