"""`./shake ros2 …`: the most used commands of the `ros2` program, where ROS 2 is not installed.

The words, options and lines are those of `ros2 topic list|echo|hz`, `ros2 param list|get|set|dump` and
`ros2 service list|call`; whatever else that program can do, it needs an installed ROS 2 for.
"""

from __future__ import annotations

import argparse
import array
import contextlib
import math
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import yaml
from rclpy.context import Context
from rclpy.parameter import Parameter, get_parameter_value, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile

from shake_ros.quantities import ShakeError
from shake_ros.ros.graph_client import GraphClient
from shake_ros.ros.interface import interface_class, matching
from shake_ros.ros.loop import ros_context

DISCOVERY = 1.0  # names are gathered for so long [s]
TIMEOUT = 5.0  # for what must be there [s]
REPORT = 1.0  # between two lines of `hz` [s]
LONGEST = 128  # elements of an array, characters of a text, that `echo` shows
HZ_WINDOW = 10000  # messages
KINDS = {1: "Boolean value is:", 2: "Integer value is:", 3: "Double value is:", 4: "String value is:"}
HIDDEN = "_"  # how names of what is not for people begin


class Console(GraphClient):
    """A node of one's own, to look and ask."""

    def __init__(self, context: Context) -> None:
        super().__init__(context, "_shake_ros2")

    def gathered(self, look: Callable[[], list[Any]]) -> list[Any]:
        """All that there is, sorted: until for DISCOVERY nothing has been added, with twice the time for the first."""
        found, changed, first = sorted(look()), time.monotonic(), True
        while time.monotonic() - changed < DISCOVERY * (2.0 if first else 1.0):
            self.look()
            if (now := sorted(look())) != found:
                found, changed, first = now, time.monotonic(), False
        return found

    def parameters(self, name: str) -> AsyncParameterClient:
        """Client of the parameters of a node, by its name with or without the first slash."""
        full = f"/{name.lstrip('/')}"
        if not self.until(lambda: full in nodes(self), TIMEOUT):
            raise ShakeError("Node not found")
        client = AsyncParameterClient(self.node, full)
        if not self.until(client.services_are_ready, TIMEOUT):
            raise ShakeError(f"Wait for service timed out waiting for parameter services for node {full}")
        return client


def nodes(console: Console) -> list[str]:
    """Full names of all nodes that are for people."""
    found = console.node.get_node_names_and_namespaces()
    return sorted(f"{space.rstrip('/')}/{name}" for name, space in found if not name.startswith(HIDDEN))


def show(value: Any) -> Any:
    """A message as plain values, arrays and texts cut to LONGEST."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: show(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, str):
        return value if len(value) <= LONGEST else f"{value[:LONGEST]}..."
    if isinstance(value, bytes):
        return value[0] if len(value) == 1 else list(value[:LONGEST])
    if isinstance(value, list | tuple | array.array) or hasattr(value, "tolist"):
        items = list(value) if not hasattr(value, "tolist") else value.tolist()
        if not isinstance(items, list):
            return items
        return [show(item) for item in items[:LONGEST]] + (["..."] if len(items) > LONGEST else [])
    return value


def fill(message: Any, content: Any) -> Any:
    """A message with fields set by name; raises ShakeError for a field that it has not, or of another type."""
    for name, value in (content or {}).items():
        try:
            inner = getattr(message, name)
            nested = hasattr(inner, "get_fields_and_field_types")
            setattr(message, name, fill(inner, value) if nested else type(inner)(value))
        except (AttributeError, AssertionError, TypeError, ValueError) as error:
            raise ShakeError(f"Failed to populate field: {error}") from None
    return message


def topic_list(console: Console, given: argparse.Namespace) -> int:
    """Names of all topics."""
    for name, types in console.gathered(console.node.get_topic_names_and_types):
        print(f"{name} [{', '.join(types)}]" if given.show_types else name)
    return 0


def _topic(console: Console, name: str) -> tuple[str, Any, QoSProfile]:
    """Full name, class and a profile that all its writers can serve."""
    full = f"/{name.lstrip('/')}"
    found = console.until(lambda: dict(console.node.get_topic_names_and_types()).get(full), TIMEOUT)
    if not found:
        raise ShakeError(f"topic [{full}] does not appear to be published yet")
    kind = interface_class(found[0])
    if kind is None:
        raise ShakeError(f"The message type '{found[0]}' is invalid")
    offered = console.until(lambda: console.node.get_publishers_info_by_topic(full), DISCOVERY)
    return full, kind, matching([info.qos_profile for info in offered])


def topic_echo(console: Console, given: argparse.Namespace) -> int:
    """Every message of a topic."""
    full, kind, profile = _topic(console, given.topic_name)
    heard: list[int] = []

    def arrived(message: Any) -> None:
        if given.once and heard:
            return
        heard.append(1)
        for part in given.field.split(".") if given.field else ():
            message = getattr(message, part)
        print(yaml.dump(show(message), sort_keys=False, allow_unicode=True, width=sys.maxsize), end="")
        print("---", flush=True)

    console.node.create_subscription(kind, full, arrived, profile)
    while not (given.once and heard):
        console.look(0.1)
    return 0


def topic_hz(console: Console, given: argparse.Namespace) -> int:
    """How often messages come, once a second."""
    full, kind, profile = _topic(console, given.topic_name)
    times: deque[float] = deque(maxlen=given.window + 1)
    console.node.create_subscription(kind, full, lambda _: times.append(time.monotonic()), profile, raw=True)
    reported, count = time.monotonic(), 0
    while given.reports == 0 or count < given.reports:
        console.look(0.01)
        if time.monotonic() - reported < REPORT or len(times) < 2:
            continue
        reported, count = time.monotonic(), count + 1
        steps = [after - before for before, after in zip(times, list(times)[1:], strict=False)]
        mean = sum(steps) / len(steps)
        spread = math.sqrt(sum((step - mean) ** 2 for step in steps) / len(steps))
        print(f"average rate: {1.0 / mean:.3f}")
        print(f"\tmin: {min(steps):.3f}s max: {max(steps):.3f}s std dev: {spread:.5f}s window: {len(steps) + 1}")
        sys.stdout.flush()
    return 0


def param_list(console: Console, given: argparse.Namespace) -> int:
    """Names of the parameters of a node, or of all."""
    for name in [given.node_name] if given.node_name else console.gathered(lambda: nodes(console)):
        with contextlib.nullcontext() if given.node_name else contextlib.suppress(ShakeError):
            names = _names(console, name)
            if not given.node_name:
                print(f"{name}:")
            print("\n".join(f"  {one}" for one in names))
    return 0


def _names(console: Console, node: str) -> list[str]:
    return sorted(console.answer(console.parameters(node).list_parameters(), node, TIMEOUT).result.names)


def param_get(console: Console, given: argparse.Namespace) -> int:
    """The value of a parameter."""
    client = console.parameters(given.node_name)
    value = console.answer(client.get_parameters([given.parameter_name]), given.node_name, TIMEOUT).values
    if not value or not value[0].type:
        raise ShakeError("Parameter not set.")
    kind, plain = KINDS.get(value[0].type, "Values are:"), parameter_value_to_python(value[0])
    print(plain if given.hide_type else f"{kind} {plain}")
    return 0


def param_set(console: Console, given: argparse.Namespace) -> int:
    """Change a parameter; its value is read as YAML."""
    client = console.parameters(given.node_name)
    value = parameter_value_to_python(get_parameter_value(given.value))
    result = console.answer(
        client.set_parameters([Parameter(given.parameter_name, value=value)]), given.node_name, TIMEOUT
    )
    done, reason = result.results[0].successful, result.results[0].reason
    text = "Set parameter successful" if done else "Setting parameter failed"
    print(f"{text}: {reason}" if reason else text, file=sys.stdout if done else sys.stderr)
    return 0 if done else 1


def param_dump(console: Console, given: argparse.Namespace) -> int:
    """All parameters of a node as a file that it can be started with."""
    names = _names(console, given.node_name)
    values = console.answer(console.parameters(given.node_name).get_parameters(names), given.node_name, TIMEOUT).values
    found: dict[str, Any] = {}
    for name, value in zip(names, values, strict=True):
        *folders, leaf = name.split(".")
        place = found
        for folder in folders:
            place = place.setdefault(folder, {})
        place[leaf] = parameter_value_to_python(value)
    content = {f"/{given.node_name.lstrip('/')}": {"ros__parameters": found}}
    print(yaml.dump(content, default_flow_style=False))
    return 0


def service_list(console: Console, given: argparse.Namespace) -> int:
    """Names of all services."""
    for name, types in console.gathered(console.node.get_service_names_and_types):
        print(f"{name} [{', '.join(types)}]" if given.show_types else name)
    return 0


def service_call(console: Console, given: argparse.Namespace) -> int:
    """Ask a service."""
    kind = interface_class(given.service_type)
    if kind is None or not hasattr(kind, "Request"):
        raise ShakeError("The passed service type is invalid")
    request = fill(kind.Request(), yaml.safe_load(given.values))
    client: Any = console.node.create_client(kind, f"/{given.service_name.lstrip('/')}")
    if not client.service_is_ready():
        print("waiting for service to become available...", flush=True)
    if not console.until(client.service_is_ready, TIMEOUT):
        raise ShakeError(f"service {given.service_name} is not there")
    print(f"requester: making request: {request!r}\n")
    print(f"response:\n{console.answer(client.call_async(request), given.service_name, TIMEOUT)!r}\n")
    return 0


def parser() -> argparse.ArgumentParser:
    """The command line, as that of `ros2`."""
    top = argparse.ArgumentParser(prog="ros2", description=(__doc__ or "").split("\n\n")[0])
    groups = top.add_subparsers(required=True, metavar="topic | param | service")
    verbs: dict[str, Any] = {}
    for name in ("topic", "param", "service"):
        verbs[name] = groups.add_parser(name).add_subparsers(required=True)

    def verb(group: str, name: str, run: Callable[..., int], *arguments: str) -> argparse.ArgumentParser:
        made: argparse.ArgumentParser = verbs[group].add_parser(name, help=run.__doc__)
        made.set_defaults(run=run)
        for one in arguments:
            made.add_argument(one)
        return made

    for group, listing in (("topic", topic_list), ("service", service_list)):
        verb(group, "list", listing).add_argument("-t", "--show-types", action="store_true")
    echo = verb("topic", "echo", topic_echo, "topic_name")
    echo.add_argument("--once", action="store_true", help="the first message alone")
    echo.add_argument("--field", default="", help="a part of each message, as header.stamp")
    hz = verb("topic", "hz", topic_hz, "topic_name")
    hz.add_argument("-w", "--window", type=int, default=HZ_WINDOW, help="messages to average over")
    hz.add_argument("--reports", type=int, default=0, help="end after so many; 0: never")
    verb("param", "list", param_list).add_argument("node_name", nargs="?", default="")
    verb("param", "get", param_get, "node_name", "parameter_name").add_argument("--hide-type", action="store_true")
    verb("param", "set", param_set, "node_name", "parameter_name", "value")
    verb("param", "dump", param_dump, "node_name")
    call = verb("service", "call", service_call, "service_name", "service_type")
    call.add_argument("values", nargs="?", default="{}")
    return top


def main(arguments: Sequence[str]) -> int:
    """Run one command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    with ros_context([]) as context:
        console = Console(context)
        try:
            return int(given.run(console, given))
        finally:
            console.close()
