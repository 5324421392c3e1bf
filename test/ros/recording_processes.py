"""A recorder or player as a process, and a node in the test that talks to it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from shake_ros.ros.interface import NAMESPACE
from shake_ros.ros.loop import ros_context

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 30.0


@contextmanager
def process(name: str, *, remaps: tuple[str, ...] = (), **parameters: Any) -> Iterator[subprocess.Popen[str]]:
    """A node of this package as a process; killed at the end where it still runs."""
    arguments = ["--ros-args", "-r", f"__ns:={NAMESPACE}"]
    for remap in remaps:
        arguments += ["-r", remap]
    for key, value in parameters.items():
        text = str(value).lower() if isinstance(value, bool) else f"'{value}'" if isinstance(value, str) else str(value)
        arguments += ["-p", f"{key}:={text}"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "shake_ros", name, *arguments]
    started = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        yield started
    finally:
        if started.poll() is None:
            started.kill()
        started.communicate()


def end(started: subprocess.Popen[str], number: int = signal.SIGINT) -> int:
    """Send a signal and return the exit code."""
    started.send_signal(number)
    return started.wait(TIMEOUT)


@contextmanager
def own_node(domain: int) -> Iterator[Node]:
    """A node of the test."""
    with ros_context([], domain_id=domain) as context:
        node = Node("test", namespace=NAMESPACE, context=context, start_parameter_services=False)
        try:
            yield node
        finally:
            node.destroy_node()


def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Return as soon as the condition holds; fail after TIMEOUT seconds."""
    deadline = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < deadline, f"not within {TIMEOUT:g} s: {what}"
        time.sleep(0.01)


def spin_until(node: Node, condition: Callable[[], bool], what: str, seconds: float = TIMEOUT) -> None:
    """Serve the test's subscriptions until the condition holds."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"not within {seconds:g} s: {what}"
        executor.spin_once(timeout_sec=0.05)
    executor.remove_node(node)
    executor.shutdown()
