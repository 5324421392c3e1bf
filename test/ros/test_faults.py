"""A fault of a sensor and one of the commands end as configured and are over after reset: over plant and bridge."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from machine_time import on_a_machine_that_keeps_time
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from benchmarks.realtime.driver import Driver
from benchmarks.realtime.emulated_target import emulated_target
from benchmarks.realtime.listener import Listener
from shake_ros.quantities import ShakeError
from shake_ros.ros.conversions import codec
from shake_ros.ros.faults_node import build, parse_topics
from shake_ros.ros.graph import Graph, NodeSpec
from shake_ros.ros.interface import VALVE_COMMAND
from shake_ros.ros.loop import build_node, ros_context
from shake_ros.ros.plant_node import build as build_plant
from shake_ros.settings import find, read_yaml

TIMEOUT = 40.0
MS = 1_000_000
START = 1000 * MS
WATCHED = ("stop", "sensor_missing", "command_not_finite", "target_trip")
NODE = {"plant": "plant", "bridge": "hardware_bridge"}


def interlock(name: str, folder: Path) -> str:
    """A configured interlock that only watches what this test brings about: a busy machine must not trip the rest."""
    content: dict[str, Any] = dict(read_yaml(find("interlock", name)))
    content |= {"low_pressure_time": 0.1, "high_pressure_time": 0.1, "span_time": 0.1}
    for cause, response in content["causes"].items():
        if cause not in WATCHED:
            response |= {"action": "none", "latch": False}
    content["causes"]["sensor_missing"]["threshold"] = 1.5
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(content))
    return str(path)


@contextmanager
def table(link: str, folder: Path) -> Iterator[tuple[dict[str, Any], subprocess.Popen[str] | None]]:
    """Parameters of the table's node, and the emulator's process where there is one."""
    parameters: dict[str, Any] = {
        "interlock.configuration": interlock("bergamo", folder),
        "enabled": False,
        "realtime.enabled": True,
    }
    if link == "plant":
        yield parameters, None
        return
    with emulated_target(folder, "--interlock", interlock("target", folder), "--priority", "50") as (emulator, path):
        yield {**parameters, "bridge": path}, emulator


class Scene:
    """A table in motion that faults come over."""

    def __init__(self, node: str, listener: Listener, driver: Driver) -> None:
        self.node = node
        self.listener = listener
        self.driver = driver

    def expect(self, text: str) -> dict[str, str]:
        return self.listener.wait_for_status(self.node, text, TIMEOUT)

    def go(self) -> None:
        """Reset, enable, and the table moves."""
        for service, request in (("reset", {}), ("enable", {"data": True})):
            deadline = time.monotonic() + TIMEOUT
            while not (answer := self.driver.service(service, **request))[0]:
                assert time.monotonic() < deadline, answer
                time.sleep(0.1)
        self.expect("running")
        before = len(self.listener.raw["joint_states"])
        time.sleep(1.0)
        moved = [message.position[0] for message in self.listener.messages("joint_states")[before:]]
        assert max(moved) - min(moved) > 2e-3

    def trips(self) -> list[tuple[str, str]]:
        """Cause and action of every trip that was said."""
        found = []
        for message in self.listener.messages("/diagnostics"):
            for status in message.status:
                values = {item.key: item.value for item in status.values}
                if status.name.endswith(f"{self.node}: interlock"):
                    found.append((values["cause"], values["action"]))
        return found


@pytest.mark.second_tier
@pytest.mark.parametrize("link", ["plant", "bridge"])
@on_a_machine_that_keeps_time
def test_fault_of_a_sensor_and_of_the_command_end_as_configured_and_are_over_after_reset(
    ros_domain, tmp_path, link
) -> None:
    node = NODE[link]
    with (
        table(link, tmp_path) as (parameters, emulator),
        Listener(("joint_states", "/diagnostics"), lockstep=False, domain_id=ros_domain) as listener,
        Driver(domain_id=ros_domain, node=node) as driver,
        Driver(domain_id=ros_domain, node="faults") as between,
    ):
        for one in (driver, between):
            one.node.destroy_publisher(one.publisher)
        nodes = [
            NodeSpec(node, parameters),
            NodeSpec("reference_generator", {"reference": "sine_20mm_2hz"}),
            NodeSpec("observer"),
            NodeSpec("controller", remaps={"valve_command": "healthy/valve_command"}),
            NodeSpec("faults", {"topics": "valve_command"}),
        ]
        scene = Scene(node, listener, driver)
        with Graph(nodes, domain_id=ros_domain, lockstep=False) as graph:
            graph.wait_until_ready()
            scene.go()

            assert between.set_parameter("valve_command.nan", 1.0)[0]
            scene.expect("safe hold")
            assert ("command_not_finite", "program_hold") in scene.trips()
            assert between.set_parameter("valve_command.nan", 0.0)[0]
            scene.go()

            if emulator is None:
                assert driver.set_parameter("faults.position_off", True)[0]
            else:
                assert emulator.stdin is not None
                print("position_off", file=emulator.stdin, flush=True)
            status = scene.expect("hydraulic interlock")
            assert status["stage"] == "off"
            assert ("sensor_missing", "hydraulic_interlock") in scene.trips()
            if emulator is None:
                assert driver.set_parameter("faults.position_off", False)[0]
            else:
                print("position_off off", file=emulator.stdin, flush=True)
            scene.go()
            graph.stop()


def test_sensor_without_a_reading_takes_the_pressure_off_until_it_is_back_and_reset(ros_domain) -> None:
    arguments = ["--ros-args", "-p", "enabled:=true", "-p", "interlock.configuration:=bergamo"]
    with ros_context([], domain_id=ros_domain) as context:
        node = build_node(build_plant, "plant", context, arguments)
        lock = node.interlock

        def tick(first: int, last: int) -> None:
            for k in range(first, last):
                lock.command(START + (k - 1) * MS, 0.0)
                node.tick(START + k * MS, 1)

        def switch(on: bool) -> None:
            assert node.frame.node.set_parameters([Parameter("faults.position_off", value=on)])[0].successful

        node.start()
        tick(0, 50)
        assert not any(trip.cause == "sensor_missing" for trip in lock.core.trips)
        switch(True)
        tick(50, 300)
        assert ("sensor_missing", "hydraulic_interlock") in {(trip.cause, trip.action) for trip in lock.core.trips}
        assert not lock._reset(Trigger.Request(), Trigger.Response()).success
        switch(False)
        tick(300, 400)
        assert lock._reset(Trigger.Request(), Trigger.Response()).success
        node.frame.close()


def test_node_between_changes_a_command_while_its_fault_is_on(ros_domain) -> None:
    passed: list[bytes] = []
    command = codec(VALVE_COMMAND)
    with ros_context([], domain_id=ros_domain) as context:
        node = build_node(build, "faults", context, ["--ros-args", "-p", "topics:=valve_command"])
        (channel,) = node._channels
        channel._publisher = SimpleNamespace(publish=passed.append)
        for k, share in enumerate((0.0, 1.0, 0.0)):
            assert node.frame.node.set_parameters([Parameter("valve_command.nan", value=share)])[0].successful
            channel._arrived(command.encode(START + k * MS, (0.25,)))
        node.frame.close()
    stamps, values = zip(*(command.decode(data) for data in passed), strict=True)
    assert stamps == tuple(START + k * MS for k in range(3))
    np.testing.assert_array_equal(values, [(0.25,), (np.nan,), (0.25,)])


def test_plant_in_lockstep_refuses_a_sensor_that_says_nothing(ros_domain) -> None:
    arguments = ["--ros-args", "-p", "lockstep:=true", "-p", "faults.position_off:=true"]
    with (
        ros_context([], domain_id=ros_domain) as context,
        pytest.raises(ShakeError, match=r"faults.position_off: in lock-step the nodes would wait for ever"),
    ):
        build_node(build_plant, "plant", context, arguments)


@pytest.mark.parametrize(
    ("topics", "reason"),
    [("", "name at least one"), ("imu thd", "unknown sampled topic 'thd'"), ("imu imu", "'imu' is named twice")],
)
def test_topics_that_cannot_pass_are_refused(topics, reason) -> None:
    with pytest.raises(ShakeError, match=reason):
        parse_topics(topics)


def test_node_between_is_refused_in_lockstep(ros_domain) -> None:
    with (
        ros_context([], domain_id=ros_domain) as context,
        pytest.raises(ShakeError, match="real time only"),
    ):
        build_node(build, "faults", context, ["--ros-args", "-p", "lockstep:=true"])
