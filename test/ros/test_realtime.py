"""What every node asks of the operating system in real time is there, or one line says what is not."""

from __future__ import annotations

import ctypes
import gc
import os
import resource
import subprocess
import sys
import time
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.realtime.listener import Listener
from shake_ros import realtime
from shake_ros.entry_points import NODES
from shake_ros.quantities import ShakeError
from shake_ros.realtime import RealtimeParameters
from shake_ros.recordings.bags import write_table_recording
from shake_ros.ros.graph import Graph, NodeSpec

PRIORITY, PROCESSOR = 42, min(os.sched_getaffinity(0))
ASKED = {
    "realtime.enabled": True, "realtime.priority": PRIORITY, "realtime.cpu": PROCESSOR, "realtime.stay_awake": False,
    "rate": 100.0,
}  # fmt: skip
PR_CAPBSET_DROP, CAP_IPC_LOCK, CAP_SYS_NICE = 24, 14, 23
TIMEOUT = 40.0
RUNAWAY = 10_000_000  # at SCHED_FIFO without ever waiting [us]
GROUPS = [tuple(NODES)[i : i + 3] for i in range(0, len(NODES), 3)]
THREES = [pytest.param(g, id="-".join(g), marks=pytest.mark.second_tier if g != GROUPS[0] else []) for g in GROUPS]
WARNING = (
    f"real time: runs without locked memory (Cannot allocate memory), SCHED_FIFO {PRIORITY} (Operation not permitted)"
)


def without_rights() -> None:
    """What follows in this process and its children may neither lock memory nor take a priority, as a fresh user."""
    for capability in (CAP_IPC_LOCK, CAP_SYS_NICE):
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (1 << 16, 1 << 16))


@pytest.fixture(scope="module")
def allowed() -> None:
    """Skip where this user may not have what is to be shown."""
    program = (
        "from shake_ros.realtime import *\n"
        f"print(ask_for(RealtimeParameters(True, {PRIORITY}, {PROCESSOR}, True, True, False)))"
    )
    refused = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.strip()
    if refused:
        pytest.skip(f"this user {refused}")


def limited(monkeypatch: pytest.MonkeyPatch, limit: Callable[[], None]) -> None:
    """Processes of a graph call `limit` before they start."""
    start = subprocess.Popen

    def begin(*arguments: Any, preexec_fn: Callable[[], None], **options: Any) -> Any:
        def prepare() -> None:
            preexec_fn()
            limit()

        return start(*arguments, preexec_fn=prepare, **options)

    monkeypatch.setattr(subprocess, "Popen", begin)


@pytest.fixture
def not_endless(monkeypatch) -> None:
    """A node that would keep a processor for itself is ended by the system."""
    limited(monkeypatch, lambda: resource.setrlimit(resource.RLIMIT_RTTIME, (RUNAWAY, RUNAWAY)))


@pytest.fixture
def unprivileged(monkeypatch) -> None:
    """Nodes of a graph start without the rights."""
    limited(monkeypatch, without_rights)


def threads(process: int) -> list[int]:
    return [int(name) for name in os.listdir(f"/proc/{process}/task")]


def locked_kilobytes(process: int) -> int:
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmLck:"))


@pytest.mark.parametrize("names", THREES)
def test_every_node_has_the_priority_the_processor_and_the_locked_memory_that_it_asked_for(
    ros_domain, allowed, not_endless, tmp_path, names
) -> None:
    time_, zero = np.arange(50) * 0.01, np.zeros(50)
    bag = write_table_recording(tmp_path / "run", time=time_, valve_command=zero, position=np.sin(time_))
    own = {
        "player": {"input": str(bag), "loop": True},
        "recorder": {"output": str(tmp_path / "bag")},
        "page": {"port": 0},
        "twin": {"table": "bergamo"},
    }
    sensors = ("joint_states", "imu", "pressure_a", "pressure_b", "pressure_supply")
    apart = {topic: f"other/{topic}" for topic in sensors}
    remaps = {"hardware_bridge": apart, "faults": {"valve_command": "other/valve_command"}}
    nodes = [NodeSpec(name, {**ASKED, **own.get(name, {})}, remaps=remaps.get(name, {})) for name in names]
    with (
        Listener(["/diagnostics"], lockstep=False, domain_id=ros_domain) as listener,
        Graph(nodes, domain_id=ros_domain, lockstep=False) as graph,
    ):
        deadline = time.monotonic() + TIMEOUT
        for name in names:
            while "realtime" not in (listener.status(name) or {}):
                graph.check()
                assert time.monotonic() < deadline, f"{name} says nothing of real time: {graph.output(name)}"
                time.sleep(0.05)
        for name, process in graph.processes.items():
            for thread in threads(process.pid):
                assert os.sched_getscheduler(thread) == os.SCHED_FIFO, name
                assert os.sched_getparam(thread).sched_priority == PRIORITY, name
                assert os.sched_getaffinity(thread) == {PROCESSOR}, name
            assert locked_kilobytes(process.pid) > 10_000, name
            said = listener.status(name)["realtime"]
            assert said == f"SCHED_FIFO {PRIORITY}, processor {PROCESSOR}, memory locked, collector held"
            assert "runs without" not in graph.output(name)


def test_a_node_without_the_rights_runs_on_and_warns_once(ros_domain, unprivileged) -> None:
    nodes = [NodeSpec("plant", {**ASKED, "duration": 2.5})]
    with (
        Listener(["/diagnostics"], lockstep=False, domain_id=ros_domain) as listener,
        Graph(nodes, domain_id=ros_domain, lockstep=False) as graph,
    ):
        process = graph.processes["plant"].pid
        listener.wait_for_status("plant", "waiting for the first command", TIMEOUT)
        while "realtime" not in listener.status("plant"):
            graph.check()
            time.sleep(0.05)
        assert {os.sched_getscheduler(thread) for thread in threads(process)} == {os.SCHED_OTHER}
        assert {frozenset(os.sched_getaffinity(thread)) for thread in threads(process)} == {frozenset({PROCESSOR})}
        assert locked_kilobytes(process) == 0
        graph.wait(TIMEOUT)
        assert graph.output("plant").count("runs without") == 1
        assert WARNING in graph.output("plant")
        assert "done: 250 samples" in graph.output("plant")
    assert (
        listener.status("plant")["realtime"]
        == f"usual scheduling, processor {PROCESSOR}, memory not locked, collector held"
    )


def test_nothing_is_asked_for_unless_it_is_enabled() -> None:
    before = realtime.in_force()
    assert realtime.ask_for(RealtimeParameters(False, PRIORITY, PROCESSOR, True, True, True)) == ""
    assert realtime.in_force() == before


def test_collector_that_is_held_works_when_told_and_is_let_go_as_it_was() -> None:
    class Node:
        pass

    def cycle() -> weakref.ref[Node]:
        node = Node()
        node.me = node  # type: ignore[attr-defined]
        return weakref.ref(node)

    realtime.hold_collector()
    try:
        assert realtime.in_force().endswith("collector held")
        left = cycle()
        [[] for _ in range(100_000)]
        assert left() is not None  # no collection of its own accord
        realtime.collect()
        assert left() is None
    finally:
        realtime.release_collector()
    assert gc.isenabled() and gc.get_freeze_count() == 0
    assert realtime.in_force().endswith("collector at work")


def test_what_a_late_import_leaves_is_held_as_well() -> None:
    realtime.hold_collector()
    try:
        held = gc.get_freeze_count()
        few = [[] for _ in range(100)]
        realtime.collect()
        assert gc.get_freeze_count() == held
        many = [[] for _ in range(2 * realtime.MANY)]
        realtime.collect()
        assert gc.get_freeze_count() >= held + len(few) + len(many)
    finally:
        realtime.release_collector()


def test_a_processor_that_is_not_there_is_named() -> None:
    wanted = RealtimeParameters(True, 0, 4095, False, False, False)
    assert realtime.ask_for(wanted) == "real time: runs without processor 4095 (Invalid argument)"


@pytest.mark.parametrize(("name", "value"), [("priority", 100), ("priority", -1), ("cpu", -2)])
def test_priority_and_processor_have_bounds(name, value) -> None:
    fields = {"enabled": True, "priority": 80, "cpu": -1, "lock_memory": True, "freeze_collector": True}
    fields["stay_awake"] = True
    with pytest.raises(ShakeError, match=f"{name} = {value} is outside"):
        RealtimeParameters(**{**fields, name: value})


def test_processors_stay_awake_while_the_process_holds_them_so(monkeypatch, tmp_path) -> None:
    device = tmp_path / "cpu_dma_latency"
    device.write_bytes(b"")
    monkeypatch.setattr(realtime, "WAKING", device)
    try:
        assert realtime.ask_for(RealtimeParameters(True, 0, -1, False, False, True)) == ""
        assert device.read_bytes() == b"\0\0\0\0"  # a request of 0 us, as the kernel reads it
        assert "processors awake" in realtime.in_force()
    finally:
        realtime.awake.release()
    assert "processors awake" not in realtime.in_force()


def test_processors_that_may_not_be_kept_awake_are_named(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(realtime, "WAKING", tmp_path / "none")
    refused = realtime.ask_for(RealtimeParameters(True, 0, -1, False, False, True))
    assert refused == "real time: runs without processors that stay awake (No such file or directory)"
