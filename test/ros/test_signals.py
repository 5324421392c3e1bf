"""Ctrl-C as people and launchers send it: several times within milliseconds, or while a node still compiles."""

from __future__ import annotations

import time

import pytest
from machine_time import on_a_machine_that_keeps_time
from node_process import TIMEOUT, NodeProcess

from shake_ros.ros import interface
from shake_ros.ros.frame import Frame
from shake_ros.ros.loop import ros_context

LATER = pytest.mark.second_tier


@pytest.mark.parametrize("name", ["thd_analyzer", pytest.param("reference_generator", marks=LATER), "recorder"])
@pytest.mark.parametrize(
    "pauses", [(0.003, 0.01), pytest.param((0.0,), marks=LATER), pytest.param((0.02, 0.05, 0.1), marks=LATER)]
)
def test_signals_that_come_in_a_bunch_end_a_node_in_good_order(ros_domain, tmp_path, name, pauses) -> None:
    output = ["-p", f"output:={tmp_path / 'run'}"] if name == "recorder" else []
    node = NodeProcess(ros_domain, tmp_path, name, *output)
    node.wait_for("running")
    assert node.end(*pauses) == 0, node.said()
    assert "Traceback" not in node.said()


@pytest.mark.second_tier
@on_a_machine_that_keeps_time
def test_node_that_compiles_says_so_and_ends_at_once_when_told(ros_domain, tmp_path) -> None:
    node = NodeProcess(ros_domain, tmp_path, "plant", NUMBA_CACHE_DIR=str(tmp_path / "empty"))
    node.wait_for("compiling, as at every first start")
    began = time.monotonic()
    assert node.end(0.002) == 0, node.said()
    assert time.monotonic() - began < 5.0
    assert "running" not in node.said() and "Traceback" not in node.said()


@pytest.mark.second_tier
def test_node_that_has_refused_every_command_tells_no_latency(ros_domain, tmp_path) -> None:
    """The time since the first of January 1970 is not one."""
    node = NodeProcess(ros_domain, tmp_path, "plant")
    node.wait_for("running")
    with ros_context([], domain_id=ros_domain) as context:
        sender = Frame("sender", context, ["--ros-args"])
        commands = sender.writer(interface.VALVE_COMMAND)
        deadline = time.monotonic() + TIMEOUT
        while "no stamp" not in node.said():
            commands.send(0, 0.1)
            time.sleep(0.05)
            assert time.monotonic() < deadline
        time.sleep(5.5)  # what settles is not told
        commands.send(0, 0.1)
        sender.close()
    assert node.end() == 0
    assert "latency" not in node.said().split("whole run")[-1] and "period jitter" in node.said()
