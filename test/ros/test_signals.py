"""Ctrl-C as people and launchers send it: several times within milliseconds, or while a node still compiles."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 60.0


class Process:
    """A node as a process, and what it has said."""

    def __init__(self, domain: int, folder: Path, name: str, *arguments: str, **environment: str) -> None:
        self.log = folder / f"{name}.log"
        settings = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "PYTHONPATH": str(ROOT)}
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "shake_ros", name, "--ros-args", *arguments],
                env={**os.environ, **settings, **environment},
                stdout=log,
                stderr=log,
            )

    def said(self) -> str:
        return self.log.read_text(errors="replace")

    def wait_for(self, text: str) -> None:
        deadline = time.monotonic() + PATIENCE
        while text not in self.said():
            assert time.monotonic() < deadline and self.process.poll() is None, self.said()
            time.sleep(0.02)

    def end(self, *pauses: float, patience: float = 20.0) -> int:
        """SIGINT, and another one after each pause [s]; the exit code."""
        for pause in (0.0, *pauses):
            time.sleep(pause)
            self.process.send_signal(signal.SIGINT)
        return self.process.wait(patience)


@pytest.mark.parametrize("name", ["thd_analyzer", "reference_generator", "recorder"])
@pytest.mark.parametrize("pauses", [(0.0,), (0.003, 0.01), (0.02, 0.05, 0.1)])
def test_signals_that_come_in_a_bunch_end_a_node_in_good_order(ros_domain, tmp_path, name, pauses) -> None:
    node = Process(
        ros_domain, tmp_path, name, "-p", "reference:=none" if name == "reference_generator" else "orders:=5"
    )
    node.wait_for("running")
    assert node.end(*pauses) == 0, node.said()
    assert "Traceback" not in node.said()


def test_node_that_compiles_says_so_and_ends_at_once_when_told(ros_domain, tmp_path) -> None:
    node = Process(ros_domain, tmp_path, "plant", NUMBA_CACHE_DIR=str(tmp_path / "empty"))
    node.wait_for("compiling, as always at the first start")
    began = time.monotonic()
    assert node.end(0.002) == 0, node.said()
    assert time.monotonic() - began < 5.0
    assert "running" not in node.said() and "Traceback" not in node.said()


def test_node_that_has_refused_every_command_tells_no_latency(ros_domain, tmp_path) -> None:
    """The time since the first of January 1970 is not one."""
    from shake_ros.ros import interface
    from shake_ros.ros.frame import Frame
    from shake_ros.ros.loop import ros_context

    node = Process(ros_domain, tmp_path, "plant")
    node.wait_for("running")
    with ros_context([], domain_id=ros_domain) as context:
        sender = Frame("sender", context, ["--ros-args"])
        commands = sender.writer(interface.VALVE_COMMAND)
        deadline = time.monotonic() + PATIENCE
        while "no stamp" not in node.said():
            commands.send(0, 0.1)
            time.sleep(0.05)
            assert time.monotonic() < deadline
        time.sleep(5.5)  # what settles is not told
        commands.send(0, 0.1)
        sender.close()
    assert node.end() == 0
    assert "latency" not in node.said().split("whole run")[-1] and "period jitter" in node.said()
