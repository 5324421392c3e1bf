"""The bridge in place of the plant: the closed loop over DDS and datagrams to an emulated target."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from machine_time import on_a_machine_that_keeps_time

from benchmarks.realtime.driver import Driver
from benchmarks.realtime.emulated_target import emulated_target
from benchmarks.realtime.listener import Listener
from shake_ros.quantities import ShakeError
from shake_ros.ros.graph import Graph, NodeSpec
from shake_ros.ros.hardware_bridge_node import build
from shake_ros.ros.loop import build_node, ros_context
from shake_ros.settings import config_folder

TIMEOUT = 20.0
RELAXED = (
    "sensor_missing",
    "link_loss",
    "tracking_error",
    "clock_jump",
    "command_lost",
    "target_trip",
    "valve_implausible",
    "two_commanders",
    "stale_reference",
)


@contextmanager
def bridge(tmp_path: Path) -> Iterator[str]:
    """An emulator on a free port; the path of the bridge's configuration for it."""
    target = tmp_path / "target.yaml"
    relaxed = (config_folder() / "interlock" / "target.yaml").read_text()
    target.write_text(relaxed.replace("command_lost: {threshold: 0.2", "command_lost: {threshold: 5.0"))
    with emulated_target(tmp_path, "--interlock", str(target)) as (_, path):
        yield path


def wait_for(driver: Driver, service: str, **request: object) -> None:
    """Call a service until it succeeds."""
    deadline = time.monotonic() + TIMEOUT
    while not (answer := driver.service(service, **request))[0]:
        assert time.monotonic() < deadline, answer
        time.sleep(0.1)


@pytest.mark.second_tier
@on_a_machine_that_keeps_time
def test_loop_runs_over_the_bridge_as_over_the_plant_once_it_is_enabled(ros_domain, tmp_path) -> None:
    with bridge(tmp_path) as path:
        run_over(path, ros_domain)


def run_over(bridge: str, ros_domain: int) -> None:
    """Enable, run, stop and reset, each as it should be."""
    # the other nodes have no priority: what guards a real table stands back
    causes = {f"interlock.causes.{name}.action": "none" for name in RELAXED}
    parameters = {"bridge": bridge, "interlock.causes.stale_command.threshold": 1.0, **causes}
    nodes = [
        NodeSpec("hardware_bridge", {**parameters, "realtime.enabled": True}),
        NodeSpec("reference_generator", {"reference": "sine_20mm_2hz"}),
        NodeSpec("observer"),
        NodeSpec("controller"),
    ]
    topics = ("joint_states", "imu", "pressure_supply", "pressure_a", "/diagnostics")
    with (
        Listener(topics, lockstep=False, domain_id=ros_domain) as listener,
        Driver(domain_id=ros_domain, node="hardware_bridge") as driver,
    ):
        driver.node.destroy_publisher(driver.publisher)
        with Graph(nodes, domain_id=ros_domain, lockstep=False) as graph:
            graph.wait_until_ready()
            listener.wait_for_status("hardware_bridge", "not enabled", TIMEOUT)
            wait_for(driver, "enable", data=True)
            status = listener.wait_for_status("hardware_bridge", "running", TIMEOUT)
            time.sleep(1.5)
            assert driver.service("stop")[0]
            listener.wait_for_status("hardware_bridge", "stopped; waiting for reset", TIMEOUT)
            wait_for(driver, "reset")
            graph.stop()
    moved = [message.position[0] for message in listener.messages("joint_states")]
    assert max(moved) > 2e-3
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in listener.messages("imu")]
    assert all(after > before for before, after in zip(stamps, stamps[1:], strict=False))
    assert abs(stamps[-1] - time.time_ns()) < 60 * 10**9
    assert {"clock.offset_s", "clock.drift_ppm", "link.lost", "link.rejected.tag"} <= set(status)
    said = [s for m in listener.messages("/diagnostics") for s in m.status if s.name.endswith(": interlock")]
    values = {item.key: item.value for item in said[-1].values}
    assert (values["cause"], values["action"]) == ("stop", "hydraulic_interlock")
    assert {"time_ns", "value", "limit", "unit"} <= set(values)


def test_bridge_in_lockstep_is_refused(ros_domain) -> None:
    with (
        ros_context([], domain_id=ros_domain) as context,
        pytest.raises(ShakeError, match="hardware_bridge runs in real time only"),
    ):
        build_node(build, "hardware_bridge", context, ["--ros-args", "-p", "lockstep:=true"])
