"""Graphs that run in real time for the benchmarks: plant or emulated target, as processes of their own or composed.

python -m benchmarks.realtime.graphs NAME BRIDGE DOMAIN   # all nodes of a case in this process, until SIGINT
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from rclpy.serialization import deserialize_message

from benchmarks import ROOT
from benchmarks.realtime.emulated_target import emulated_target
from benchmarks.realtime.listener import Listener
from shake_ros.ros.graph import NodeSpec, run_composed
from shake_ros.ros.interface import DIAGNOSTICS

PRIORITY = 80
GRACE = 60.0  # a composed graph may take so long to end [s]


@dataclass(frozen=True)
class Case:
    """One graph and how it runs."""

    bridge: bool = False
    composed: bool = False
    fifo: bool = True
    usual: bool = False

    @property
    def table(self) -> str:
        """The node in whose place a real table would be."""
        return "hardware_bridge" if self.bridge else "plant"


CASES = {
    "usual": Case(fifo=False, usual=True),
    "unscheduled": Case(fifo=False),
    "plant": Case(),
    "plant_composed": Case(composed=True),
    "bridge": Case(bridge=True),
    "bridge_unscheduled": Case(bridge=True, fifo=False),
    "bridge_composed": Case(bridge=True, composed=True),
}


def nodes(case: Case, bridge: str) -> list[NodeSpec]:
    """The graph that is measured."""
    common = {"realtime.enabled": case.fifo, "realtime.priority": PRIORITY}
    own = {"bridge": bridge} if case.bridge else {}
    return [
        NodeSpec("reference_generator", {**common, "reference": "sine_20mm_2hz"}),
        NodeSpec("observer", common),
        NodeSpec("controller", common),
        NodeSpec(case.table, {**common, **own}),
    ]


@dataclass
class Emulator:
    """The target computer."""

    process: subprocess.Popen[str]
    bridge: str
    summary: dict[str, Any] = field(default_factory=dict)

    def stop(self) -> None:
        """End it and take what it says of the run."""
        assert self.process.stdout is not None
        self.process.terminate()
        self.summary = json.loads(self.process.stdout.read())


@contextmanager
def emulator(case: Case) -> Iterator[Emulator | None]:
    """The target computer on a free port, where the case has one."""
    if not case.bridge:
        yield None
        return
    with (
        tempfile.TemporaryDirectory() as folder,
        emulated_target(Path(folder), "--priority", str(PRIORITY)) as (process, bridge),
    ):
        yield Emulator(process, bridge)


class Composed:
    """All nodes in one process that is started for it; the same face as `Graph`."""

    def __init__(self, name: str, bridge: str, domain: int) -> None:
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (closed with the object)
        command = [sys.executable, "-X", "faulthandler", "-m", "benchmarks.realtime.graphs", name, bridge, str(domain)]
        self.processes = {"composed": subprocess.Popen(command, stdout=self._log, stderr=self._log, cwd=ROOT)}

    def __enter__(self) -> Composed:
        return self

    def __exit__(self, *_: object) -> None:
        self.processes["composed"].kill()
        self.processes["composed"].wait()

    def output(self, _name: str) -> str:
        """What it has written so far."""
        return os.pread(self._log.fileno(), 1 << 20, 0).decode(errors="replace")

    def check(self) -> None:
        """Raise where it has ended."""
        if self.processes["composed"].poll() is not None:
            raise RuntimeError(self.output("")[-2000:])

    def stop(self) -> None:
        """SIGINT, and its end."""
        process = self.processes["composed"]
        process.send_signal(signal.SIGINT)
        try:
            code = process.wait(GRACE)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGABRT)  # says where it is
            code = process.wait(GRACE)
        if code != 0:
            raise RuntimeError(self.output("")[-4000:])


class Reports:
    """The values that each node says of itself on /diagnostics, with the stamp [s]; decoded as they come."""

    def __init__(self, listener: Listener) -> None:
        self._raw = listener.raw[DIAGNOSTICS.name]
        self._seen = 0
        self.of: dict[str, list[dict[str, str]]] = {}
        self.message: dict[str, str] = {}

    def look(self) -> None:
        """Take what has come."""
        new = self._raw[self._seen :]
        self._seen += len(new)
        for message in (deserialize_message(data, DIAGNOSTICS.type) for data in new):
            stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            for status in message.status:
                name = status.name.partition(": ")[2]
                if name != "interlock":
                    values = {item.key: item.value for item in status.values}
                    self.of.setdefault(name, []).append({**values, "stamp": f"{stamp:.9f}"})
                    self.message[name] = status.message

    def change(self, node: str, value: str) -> float:
        """By how much a value has grown from the first report to the last."""
        return float(self.of[node][-1][value]) - float(self.of[node][0][value])

    def forget(self) -> None:
        """The window begins now: each node's newest report is the first."""
        self.of = {node: found[-1:] for node, found in self.of.items()}


if __name__ == "__main__":
    run_composed(nodes(CASES[sys.argv[1]], sys.argv[2]), domain_id=int(sys.argv[3]), lockstep=False, until_signal=True)
