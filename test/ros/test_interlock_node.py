"""The interlock of a node: under any name, with its words on the console, and what its services refuse."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from shake_ros.ros import interface
from shake_ros.ros.diagnostics import ERROR, OK, WARN
from shake_ros.ros.frame import Frame
from shake_ros.ros.loop import build_node, ros_context
from shake_ros.ros.plant_node import PlantNode, build

MS = 1_000_000
START = 1000 * MS
NAMES = {
    "as it is": [],
    "topic remapped": ["-r", "valve_command:=/cmd/valve"],
    "topic remapped within the namespace": ["-r", "valve_command:=valve/command"],
    "namespace": ["-r", "__ns:=/lab/one"],
    "root namespace": ["-r", "__ns:=/"],
    "node": ["-r", "__node:=table_7"],
    "all at once": ["-r", "__ns:=/lab", "-r", "__node:=table_7", "-r", "valve_command:=/cmd/valve"],
}


@contextmanager
def plant(domain: int, *arguments: str) -> Iterator[tuple[PlantNode, Any, list[tuple[int, str]]]]:
    """The node in real time, its context, and what it says on the console."""
    said: list[tuple[int, str]] = []
    with ros_context([], domain_id=domain) as context:
        node = build_node(build, "plant", context, ["--ros-args", *arguments])
        assert isinstance(node, PlantNode)
        say = node.frame.say

        def heard(level: int, text: str, key: str = "") -> None:
            if not key or key not in node.frame._said or time.monotonic() - node.frame._said[key] >= 1.0:
                said.append((level, text))
            say(level, text, key)

        node.frame.say = heard  # type: ignore[method-assign]
        yield node, context, said
        node.frame.close()


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.parametrize("name", NAMES)
def test_second_publisher_of_commands_holds_the_table_whatever_things_are_called(ros_domain, name) -> None:
    with plant(ros_domain, *NAMES[name]) as (node, context, _):
        topic = node._commands.subscription.topic_name
        others = [Node(f"commander_{k}", context=context) for k in range(2)]
        publishers = [other.create_publisher(interface.VALVE_COMMAND.type, topic, 10) for other in others]
        until(lambda: node.frame.node.count_publishers(topic) == 2)
        level, text = node.interlock.condition()
        assert level == ERROR
        assert text == f"safe hold: 2 publishers on {topic}"
        others[1].destroy_publisher(publishers[1])
        until(lambda: node.frame.node.count_publishers(topic) == 1)
        assert node.interlock._reset(Trigger.Request(), Trigger.Response()).success
        for other in others:
            other.destroy_node()


@pytest.mark.parametrize("name", NAMES)
def test_awaited_readers_and_writers_are_counted_whatever_things_are_called(ros_domain, name) -> None:
    waiting = ["-p", "wait_for:=joint_states:1", "-p", "wait_for_writers:=valve_command:1"]
    renamed = [*NAMES[name], "-r", "joint_states:=/measured"] if "remapped" in name else NAMES[name]
    with plant(ros_domain, *renamed, *waiting) as (node, context, _):
        other = Node("other", context=context)
        assert not node.frame.ready()
        measured = node.frame.resolved("joint_states")
        other.create_subscription(interface.JOINT_STATES.type, measured, lambda _: None, 10)
        until(lambda: node.frame.node.count_subscribers(measured) == 1)
        assert not node.frame.ready()
        other.create_publisher(interface.VALVE_COMMAND.type, node.frame.resolved("valve_command"), 10)
        until(node.frame.ready)
        other.destroy_node()


def test_each_cause_is_said_however_often_another_trips(ros_domain) -> None:
    """Overruns that come and go each sample do not crowd out a table at its end stop, which waits for `reset`."""
    with plant(ros_domain) as (node, _, said):
        lock = node.interlock
        for k in range(200):
            lock.watch(START + k * MS, "deadline_overruns", 1e4 if k % 2 else 0.0)
            if k == 100:
                lock.report(START + k * MS, "stop", 1.0, "somebody pressed the button")
            if k == 120:
                lock.refused(START + k * MS, "valve_command: nan refused")
            lock.refresh()
        texts = [text for _, text in said]
        assert sum("deadline_overruns" in text for text in texts) == 1
        assert "hydraulic_interlock: stop: somebody pressed the button; waits for reset" in texts
        assert "indicate: command_not_finite: valve_command: nan refused" in texts
        assert lock.core.ledger.counts["deadline_overruns"] == 100


def test_reset_is_said_and_so_is_its_refusal(ros_domain) -> None:
    with plant(ros_domain, "-p", "interlock.causes.target_trip.action:=program_stop") as (node, _, said):
        lock = node.interlock
        lock.report(START, "target_trip", 1.0, "the target has tripped")
        assert not lock._reset(Trigger.Request(), Trigger.Response()).success
        assert said[-1] == (WARN, "reset refused: the target has tripped still stands")
        lock.clear("target_trip")
        assert lock._reset(Trigger.Request(), Trigger.Response()).success
        assert said[-1][0] == OK and said[-1][1].startswith("reset: ")


def test_command_without_a_stamp_is_refused_by_that_name_and_no_second_publisher_is_suspected(ros_domain) -> None:
    with plant(ros_domain) as (node, context, _):
        sender = Frame("sender", context, ["--ros-args"])
        commands = sender.writer(interface.VALVE_COMMAND)
        until(lambda: commands.publisher.get_subscription_count() == 1)
        for _ in range(3):
            commands.send(0, 0.1)
        until(lambda: bool(node._commands.take()) or node._commands.input.refused > 0)
        until(lambda: bool(node._commands.take()) or node._commands.input.refused == 3)
        assert node._commands.input.doubled == 0
        causes = {trip.cause: trip.text for trip in node.interlock.core.trips}
        assert causes == {"command_not_finite": "valve_command: no stamp (header.stamp is 0), refused"}
        sender.close()


@pytest.mark.parametrize("interlock", ["simulation", "bergamo"])
def test_enable_is_refused_until_what_was_stopped_is_reset(ros_domain, interlock) -> None:
    with plant(ros_domain, "-p", f"interlock.configuration:={interlock}") as (node, _, _said):
        lock = node.interlock

        def enable() -> SetBool.Response:
            return lock._enable(SetBool.Request(data=True), SetBool.Response())

        assert enable().success
        assert lock._stop(Trigger.Request(), Trigger.Response()).success
        refused = enable()
        assert (refused.success, refused.message) == (False, "stopped; waiting for reset")
        assert lock._enable(SetBool.Request(data=False), SetBool.Response()).success
        assert lock._reset(Trigger.Request(), Trigger.Response()).success
        assert enable().success
