"""Graphs of processes: they start, a death is noticed, and nothing outlives them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

import shake_ros.ros.graph
from shake_ros.quantities import UnknownName
from shake_ros.ros.graph import Graph, GraphError, NodeSpec, awaited
from shake_ros.ros.interface import TOPICS

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 90.0


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_unknown_node_is_an_error_that_lists_the_known_ones() -> None:
    with pytest.raises(
        UnknownName, match=r"unknown node 'plan' .*known: controller, faults, foxglove, hardware_bridge"
    ):
        Graph([NodeSpec("plan")])


def test_plant_waits_for_every_reader_of_the_graph() -> None:
    nodes = [NodeSpec("plant"), NodeSpec("observer"), NodeSpec("reference_generator", reads=("truth",))]
    assert awaited(nodes, lockstep=True) == "joint_states:2 truth:1 valve_command:2"
    everything = awaited([NodeSpec("recorder")], lockstep=True).split()
    assert {item.removesuffix(":1") for item in everything} == {t.name for t in TOPICS.values() if t.sampled}
    assert awaited([NodeSpec("recorder", {"topics": "imu thd"})], lockstep=True) == "imu:1"


def test_generator_in_real_time_has_a_clock_of_its_own_and_is_not_awaited() -> None:
    assert awaited([NodeSpec("reference_generator"), NodeSpec("observer")], lockstep=False) == (
        "joint_states:1 valve_command:1"
    )


def test_parameters_remaps_and_names_become_ros_arguments() -> None:
    spec = NodeSpec("observer", {"observer": "it's", "rate": 500.0}, remaps={"estimate": "other"}, name="second")
    text = " ".join(spec.arguments("/left", {"lockstep": True}))
    assert text == (
        "--ros-args -r __ns:=/left -r __node:=second -r estimate:=other "
        "-p lockstep:=true -p observer:='it''s' -p rate:=500.0"
    )


def wait_for_end_of_observer(graph: Graph) -> None:
    with graph:
        graph.wait(TIMEOUT, leader="observer")


def kill_controller(graph: Graph) -> None:
    with graph:
        graph.wait_until_ready(TIMEOUT)
        graph.processes["controller"].kill()
        graph.wait(TIMEOUT, leader="observer")


def test_node_that_dies_at_its_start_is_reported_with_what_it_wrote(ros_domain) -> None:
    graph = Graph([NodeSpec("controller", {"limit": 7.0}), NodeSpec("observer")], domain_id=ros_domain)
    with pytest.raises(GraphError, match=r"node controller ended with exit code 2\n.*limit = 7.0 is outside 0 … 1"):
        wait_for_end_of_observer(graph)


def test_node_that_is_killed_ends_the_graph_with_an_error(ros_domain) -> None:
    graph = Graph([NodeSpec("observer"), NodeSpec("controller")], domain_id=ros_domain)
    with pytest.raises(GraphError, match="node controller ended with exit code -9"):
        kill_controller(graph)
    assert not any(alive(process.pid) for process in graph.processes.values())


def test_sigint_ends_every_node_cleanly(ros_domain) -> None:
    nodes = [NodeSpec("observer"), NodeSpec("controller"), NodeSpec("plant"), NodeSpec("reference_generator")]
    with Graph(nodes, domain_id=ros_domain) as graph:
        graph.wait_until_ready(TIMEOUT)
        graph.stop()
        assert {process.returncode for process in graph.processes.values()} == {0}
        assert not any("Traceback" in graph.output(name) for name in graph.processes)


def end_what_is_deaf(graph: Graph) -> None:
    with graph:
        while "deaf" not in graph.output("observer"):
            time.sleep(0.01)
        graph.stop()


def test_node_that_does_not_end_is_named_with_where_it_stands(ros_domain, monkeypatch) -> None:
    code = """if True:
        import faulthandler, signal, time
        faulthandler.enable()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        def hangs(): time.sleep(60)
        print("deaf", flush=True)
        hangs()
    """
    monkeypatch.setattr(shake_ros.ros.graph, "GRACE", 0.2)
    graph = Graph([NodeSpec("observer", program=(sys.executable, "-c", code))], domain_id=ros_domain)
    with pytest.raises(GraphError, match=r"node observer did not end within 0.2 s of SIGINT\n(.*\n)*.* in hangs"):
        end_what_is_deaf(graph)


def test_nodes_die_with_the_process_that_started_them(ros_domain) -> None:
    code = textwrap.dedent("""
        import sys, time
        from shake_ros.ros.graph import Graph, NodeSpec
        with Graph([NodeSpec("observer")]) as graph:
            print(graph.processes["observer"].pid, flush=True)
            time.sleep(60)
    """)
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, cwd=ROOT)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    assert alive(child)
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    deadline = time.monotonic() + 10.0
    while alive(child) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not alive(child)
