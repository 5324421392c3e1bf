"""The graph of the campaign (campaign.py) over the two links: plant over DDS, emulated target over the bridge."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

from benchmarks import ROOT
from benchmarks.faults.cases import BRIDGE, PLANT, Case
from shake_ros.bridge.emulator import JOURNAL
from shake_ros.ros.conversions import codec
from shake_ros.ros.graph import Graph, NodeSpec
from shake_ros.ros.interface import NAMESPACE, SERVICES, TOPICS
from shake_ros.ros.loop import make_executor, ros_context
from shake_ros.safety.causes import NUMBERS
from shake_ros.settings import config_folder, load_interlock

TABLE_NODE = {PLANT: "plant", BRIDGE: "hardware_bridge"}
TIMEOUT = 30.0  # for a state [s]
ANSWER = 1.0  # for one answer of a service, which may have gone to a server that has died [s]
# A start in a second instead of in three: the stages' times and the span's; all that protects stays as it is.
QUICK = {"interlock.low_pressure_time": 0.2, "interlock.high_pressure_time": 0.2, "interlock.span_time": 0.3}
COLUMNS = ["time", "position", "velocity", "acceleration", "acting", "stage", "cause", "faults"]
NAMES = {number: name for name, number in NUMBERS.items()}


class Operator:
    """Calls services and sets parameters, and calls again where a server has died."""

    def __init__(self, domain: int) -> None:
        self._context = ros_context([], domain_id=domain)
        self.node: Any = None

    def __enter__(self) -> Operator:
        context = self._context.__enter__()
        self.node = Node("operator", namespace=NAMESPACE, context=context, start_parameter_services=False)
        self.executor = make_executor(context)
        self.executor.add_node(self.node)
        return self

    def __exit__(self, *error: Any) -> None:
        self.executor.remove_node(self.node)
        self.node.destroy_node()
        self.executor.shutdown()
        self._context.__exit__(*error)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """The answer; TimeoutError after TIMEOUT."""
        deadline = time.monotonic() + TIMEOUT
        while time.monotonic() < deadline:
            client = self.node.create_client(kind, f"{NAMESPACE}/{name}")
            try:
                if client.wait_for_service(ANSWER):
                    future = client.call_async(request)
                    self.executor.spin_until_future_complete(future, timeout_sec=ANSWER)
                    if future.done():
                        return future.result()
            finally:
                self.node.destroy_client(client)
        raise TimeoutError(f"{name} does not answer")

    def service(self, name: str, **request: Any) -> tuple[bool, str]:
        """Call `enable`, `stop` or `reset`: (success, message)."""
        kind = SERVICES[name].type
        answer = self.call(kind, name, kind.Request(**request))
        return answer.success, answer.message

    def set_parameter(self, node: str, values: dict[str, Any]) -> None:
        """Set parameters of a node; RuntimeError with its reason where it refuses."""
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        answer = self.call(SetParameters, f"{node}/set_parameters", SetParameters.Request(parameters=parameters))
        refused = [result.reason for result in answer.results if not result.successful]
        if refused:
            raise RuntimeError(f"{node}: {refused[0]}")


class Link:
    """Plant or bridge with reference, observer and controller; for the bridge the emulator besides.

    Parameters
    ----------
    kind : plant or bridge. reference : configuration that is played. through : topics pass through the node `faults`.
    priority : SCHED_FIFO, 0 for usual scheduling.
    """

    def __init__(self, kind: str, reference: str, through: bool, domain: int, priority: int) -> None:
        self.kind = kind
        self.table = TABLE_NODE[kind]
        self.common = {"realtime.enabled": priority > 0, "realtime.priority": max(priority, 1)}
        self.priority = priority
        self.through = through
        self.folder = tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None)
        self.emulator: subprocess.Popen[str] | None = None
        self.journals: list[Path] = []
        self.port = 0
        if kind == BRIDGE:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
                free.bind(("127.0.0.1", 0))
                self.port = free.getsockname()[1]
        self.graph = Graph(self._specs(reference), domain_id=domain, lockstep=False)

    def _specs(self, reference: str) -> list[NodeSpec]:
        own: dict[str, Any] = {**self.common, **QUICK, "interlock.configuration": "bergamo", "enabled": False}
        if self.kind == BRIDGE:
            path = Path(self.folder.name) / "bridge.yaml"
            path.write_text((config_folder() / "bridge" / "emulator.yaml").read_text().replace("47800", str(self.port)))
            own["bridge"] = str(path)
        away = {name: f"healthy/{name}" for name in ("valve_command", "joint_states")} if self.through else {}
        specs = [
            NodeSpec(self.table, own, remaps={n: t for n, t in away.items() if n == "joint_states"}),
            NodeSpec("reference_generator", {**self.common, "reference": reference}),
            NodeSpec("observer", {**self.common, "observer": "linear_bergamo"}),
            NodeSpec(
                "controller",
                {**self.common, "controller": "super_twisting_tuned"},
                remaps={n: t for n, t in away.items() if n == "valve_command"},
            ),
        ]
        if self.through:
            specs.append(NodeSpec("faults", {**self.common, "topics": "valve_command joint_states"}))
        return specs

    def __enter__(self) -> Link:
        if self.kind == BRIDGE:
            self.start_emulator()
        self.graph.__enter__()
        self.graph.wait_until_ready()
        return self

    def __exit__(self, *error: Any) -> None:
        self.graph.kill()
        if self.emulator is not None:
            self.emulator.kill()
            self.emulator.wait()
        self.folder.cleanup()

    def start_emulator(self) -> None:
        """Start the emulated target, with a journal of its own."""
        self.journals.append(Path(self.folder.name) / f"journal_{len(self.journals)}")
        target = Path(self.folder.name) / "target.yaml"
        text = (config_folder() / "interlock" / "target.yaml").read_text()
        target.write_text(text.replace("pressure_time: 0.5 ", "pressure_time: 0.2 "))
        arguments = ["--port", str(self.port), "--priority", str(self.priority), "--journal", str(self.journals[-1])]
        arguments += ["--interlock", str(target)]
        self.emulator = subprocess.Popen(
            [sys.executable, "-m", "shake_ros", "target_emulator", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        assert self.emulator.stdout is not None
        self.emulator.stdout.readline()

    def process(self, name: str) -> subprocess.Popen[Any]:
        """The process of a node, or of the emulator."""
        if name == "target_emulator":
            assert self.emulator is not None
            return self.emulator
        return self.graph.processes[name]

    def start_again(self, name: str) -> None:
        """A node that was killed."""
        if name == "target_emulator":
            process = self.process(name)
            process.kill()
            process.wait()
            self.start_emulator()
        else:
            self.graph.start_again(name)

    def dead(self) -> list[str]:
        """Nodes that have ended."""
        names = [*self.graph.processes, *(["target_emulator"] if self.emulator else [])]
        return [name for name in names if self.process(name).poll() is not None]

    def switch(self, operator: Operator, case: Case, on: bool) -> None:
        """A fault of the machine or of the messages on or off."""
        if case.kind == "message":
            value = case.value if on else type(case.value)()
            operator.set_parameter("faults", {case.what: value})
        elif self.kind == PLANT:
            values: dict[str, Any] = {f"faults.{case.what}": case.value if on else type(case.value)()}
            if case.what == "valve_stuck_at":
                values = {"faults.valve_opening": case.value, f"faults.{case.what}": on}
            operator.set_parameter("plant", values)
        else:
            assert self.emulator is not None and self.emulator.stdin is not None
            setting = "" if case.value is True else f"={case.value}"
            self.emulator.stdin.write(f"{case.what}{setting}\n" if on else f"{case.what} off\n")
            self.emulator.stdin.flush()

    def truth(self, listener: Any, since: int) -> np.ndarray:
        """What the table truly did since a time [ns], columns COLUMNS; of the plant the first four, the rest NaN."""
        if self.kind == PLANT:
            found = tail(listener, "truth", since)
            return np.column_stack([found, np.full((len(found), len(COLUMNS) - 4), np.nan)])
        rows = []
        for path in self.journals[-2:]:
            data = path.read_bytes()
            whole = len(data) // JOURNAL.size * JOURNAL.size
            rows += list(JOURNAL.iter_unpack(data[:whole][-30_000 * JOURNAL.size :]))
        table = np.array(rows, dtype=np.float64).reshape(-1, len(COLUMNS))
        table[:, 0] = [row[0] - since for row in rows]  # whole nanoseconds, before they become floats
        table[:, 0] *= 1e-9
        return table[table[:, 0] >= 0.0]


def tail(listener: Any, topic: str, since: int) -> np.ndarray:
    """Samples of a topic since a time [ns]: time after it [s], numbers."""
    decode = codec(TOPICS[topic]).decode
    rows: list[tuple[float, ...]] = []
    for data in reversed(listener.raw[topic]):
        stamp, values = decode(data)
        if stamp < since:
            break
        rows.append(((stamp - since) * 1e-9, *values))
    return np.array(rows[::-1]).reshape(len(rows), -1) if rows else np.zeros((0, 4))


def target_action(cause: str) -> str:
    """What the target's own interlock does about a cause."""
    return load_interlock("target").response(cause).action


def be_quick(priority: int) -> None:
    """This process before what is not real time, its children as usual."""
    try:
        for thread in os.listdir("/proc/self/task"):
            flags = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(int(thread), flags, os.sched_param(priority))
    except OSError as error:
        print(f"runs without SCHED_FIFO ({error.strerror})", file=sys.stderr)


SIGNALS = {"SIGSTOP": signal.SIGSTOP, "SIGKILL": signal.SIGKILL, "restart": signal.SIGINT}
