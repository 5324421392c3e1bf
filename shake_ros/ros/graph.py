"""Several nodes as one: separate processes, or all in this process. Nothing outlives the caller.

Used by the demo, the tests and the scripts; no launch file. The plant knows which readers to wait for, so
that no loop starts half and a lock-step recording has every sample from the first.

`python -m shake_ros.ros.graph SPECS` runs several in one process until a signal, as `lab --composed` does.

`record` is a closed-loop run of plant, reference generator, observer, controller and recorder in lock-step over DDS.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from shake_ros.entry_points import NODES
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.ros.graph_client import LiveGraph
from shake_ros.ros.interface import NAMESPACE, REFERENCE, TOPICS
from shake_ros.ros.loop import TAKEN_DOWN, NodeLoop, build_node, obey_signals, ros_context

PR_SET_PDEATHSIG = 1
POLL = 0.02  # [s]
GRACE = 10.0  # a node may take so long [s] to end after SIGINT
ROOT = Path(__file__).resolve().parents[2]
STACK = 40  # last lines of a node that does not end, with the stacks of its threads
Value = bool | int | float | str  # of a ROS parameter
LEADER = "plant"  # its end is the end of a run
CLOCKED = ("reference_generator",)  # keep a time of their own in real time, and read nothing then
RECORDER = "recorder"
LAST = (RECORDER, "page")  # stopped in this order after all others: a recorder may still hear from them

# Which sampled topics a node reads, for the plant to wait for.
READS: dict[str, tuple[str, ...]] = {
    "plant": ("valve_command",),
    "hardware_bridge": ("valve_command",),
    "reference_generator": ("joint_states",),
    "observer": ("joint_states", "valve_command"),
    "controller": ("reference", "estimate"),
    "thd_analyzer": ("imu", "reference"),
    "twin": ("valve_command", "joint_states", "imu"),
}


@dataclass(frozen=True)
class NodeSpec:
    """One node of a graph."""

    executable: str  # a name of the table of entry points
    parameters: Mapping[str, Value] = field(default_factory=dict)  # ROS parameters by name
    reads: tuple[str, ...] = ()  # sampled topics that it reads beyond those of its kind
    remaps: Mapping[str, str] = field(default_factory=dict)  # old name → new name
    name: str = ""  # of the node; the executable's where empty
    program: tuple[str, ...] = ()  # what to run instead of the executable, its arguments included

    @property
    def called(self) -> str:
        """Its name in the graph."""
        return self.name or self.executable

    def arguments(self, namespace: str, extra: Mapping[str, Value]) -> list[str]:
        """ROS arguments of this node."""
        given = ["--ros-args", "-r", f"__ns:={namespace}"]
        if self.name:
            given += ["-r", f"__node:={self.name}"]
        for old, new in self.remaps.items():
            given += ["-r", f"{old}:={new}"]
        for name, value in {**extra, **self.parameters}.items():
            given += ["-p", f"{name}:={_yaml(value)}"]
        return given


def _yaml(value: Value) -> str:
    """A parameter value as rcl reads it: YAML, texts quoted so that `1` and `true` stay texts."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    return repr(value)


def awaited(nodes: Sequence[NodeSpec], lockstep: bool) -> str:
    """The plant's `wait_for`: how many readers each topic has in this graph."""
    counts: dict[str, int] = {}
    for node in nodes:
        if node.executable in CLOCKED and not lockstep:
            continue
        for topic in (*READS.get(node.executable, ()), *_recorded(node), *node.reads):
            counts[topic] = counts.get(topic, 0) + 1
    return " ".join(f"{topic}:{count}" for topic, count in sorted(counts.items()))


def _recorded(node: NodeSpec) -> tuple[str, ...]:
    """The sampled topics that a recorder takes: all by default."""
    if node.executable != RECORDER:
        return ()
    named = str(node.parameters.get("topics", "")).split()
    return tuple(topic.name for topic in TOPICS.values() if topic.sampled and (not named or topic.name in named))


class GraphError(RuntimeError):
    """A node died or did not end; the message holds the last lines that it wrote."""


class Graph:
    """Nodes as separate processes, in a `with` block.

    Parameters
    ----------
    nodes : what to start, in this order.
    namespace, domain_id : of all of them; the domain of the environment where None.
    lockstep : for all of them.
    """

    def __init__(
        self,
        nodes: Sequence[NodeSpec],
        *,
        namespace: str = NAMESPACE,
        domain_id: int | None = None,
        lockstep: bool = True,
    ) -> None:
        for node in nodes:
            if node.executable not in NODES:
                raise unknown_name("node", node.executable, NODES)
        self.nodes = list(nodes)
        self.namespace = namespace
        self.domain_id = int(os.environ.get("ROS_DOMAIN_ID", "0")) if domain_id is None else domain_id
        self.lockstep = lockstep
        self.program = (sys.executable, "-m", "shake_ros")
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._logs: dict[str, IO[bytes]] = {}

    def extra(self, node: NodeSpec) -> dict[str, Value]:
        """Parameters that every node of this graph gets; what keeps the time waits until all the others are there."""
        common: dict[str, Value] = {"lockstep": self.lockstep}
        if node.executable == LEADER or (node.executable in CLOCKED and not self.lockstep):
            common["wait_for"] = awaited(self.nodes, self.lockstep)
        clocked = any(one.executable in CLOCKED for one in self.nodes)
        if node.executable == LEADER and not self.lockstep and clocked:
            common["wait_for_writers"] = f"{REFERENCE.name}:1"
        return common

    def __enter__(self) -> Graph:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.stop()
        finally:
            self.kill()

    def start(self) -> None:
        """Start all nodes, or none."""
        try:
            for node in self.nodes:
                self._start(node)
        except BaseException:
            self.kill()
            raise

    def _start(self, node: NodeSpec) -> None:
        log = tempfile.TemporaryFile()  # noqa: SIM115  (closed by `kill`)
        libc = ctypes.CDLL(None)
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(self.domain_id),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", "")))),
        }
        usual = [*self.program, node.executable, *node.arguments(self.namespace, self.extra(node))]
        self._logs[node.called] = log
        self.processes[node.called] = subprocess.Popen(
            node.program or usual,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            env=environment,
            start_new_session=True,
            preexec_fn=lambda: libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0),  # noqa: PLW1509  (one system call)
        )

    def add(self, node: NodeSpec) -> None:
        """Start one more node; it replaces one of its name, and whatever is left of that is killed."""
        if node.called in self.processes:
            self.processes[node.called].kill()
            self.processes[node.called].wait()
            self._logs[node.called].close()
        self.nodes = [one for one in self.nodes if one.called != node.called] + [node]
        self._start(node)

    def start_again(self, name: str) -> None:
        """Start a node anew, as it was started first."""
        self.add(next(node for node in self.nodes if node.called == name))

    def output(self, name: str) -> str:
        """What a node has written so far."""
        log = self._logs[name]
        size = os.fstat(log.fileno()).st_size
        return os.pread(log.fileno(), size, 0).decode(errors="replace")

    def failure(self, name: str) -> str:
        """How a node ended, with the last lines that it wrote."""
        tail = "\n".join(self.output(name).strip().splitlines()[-8:])
        return f"node {name} ended with exit code {self.processes[name].poll()}\n{tail}"

    def check(self, ended: Sequence[str] = ()) -> None:
        """Raise GraphError where a node has died, or has ended that is not among `ended`."""
        for name, process in self.processes.items():
            code = process.poll()
            if code is not None and not (code == 0 and name in ended):
                raise GraphError(self.failure(name))

    def wait_until_ready(self, timeout: float = 120.0) -> None:
        """Return when every node has reported on /diagnostics, so has read its parameters, compiled and started."""
        wanted = {f"{self.namespace.strip('/')}/{node.called}" for node in self.nodes}
        deadline = time.monotonic() + timeout
        with ros_context([], domain_id=self.domain_id) as context:
            probe = LiveGraph(context, self.namespace)
            while missing := wanted - {*probe.reports}:
                self.check()
                if time.monotonic() > deadline:
                    raise GraphError(f"not started after {timeout:g} s: {', '.join(sorted(missing))}")
                probe.look(POLL)
            probe.close()

    def wait(self, timeout: float, leader: str = LEADER, waiting: Callable[[], None] = lambda: None) -> None:
        """Return when `leader` has ended, which must be with exit code 0 and before any other.

        waiting : called again and again until then.
        """
        deadline = time.monotonic() + timeout
        while self.processes[leader].poll() is None:
            self.check(ended=(leader,))
            if time.monotonic() > deadline:
                raise GraphError(f"node {leader} has not ended after {timeout:g} s")
            waiting()
            time.sleep(POLL)
        self.check(ended=(leader,))

    def end(self, names: Sequence[str]) -> list[str]:
        """SIGINT to these; what has not ended within GRACE, or has failed, is in the answer.

        One that has not yet come to handle signals is ended by it, which is no failure.
        """
        for name in names:
            if self.processes[name].poll() is None:
                self.processes[name].send_signal(signal.SIGINT)
        deadline = time.monotonic() + GRACE
        wrong = []
        for name in names:
            try:
                code = self.processes[name].wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                wrong.append(self._did_not_end(name))
            else:
                wrong += [self.failure(name)] if code not in (0, -signal.SIGINT) else []
        return wrong

    def _did_not_end(self, name: str) -> str:
        """Where a node stands that does not end; it is killed for that."""
        process = self.processes[name]
        process.send_signal(signal.SIGABRT)  # says it
        with suppress(subprocess.TimeoutExpired):
            process.wait(GRACE)
        tail = "\n".join(self.output(name).strip().splitlines()[-STACK:])
        return f"node {name} did not end within {GRACE:g} s of SIGINT\n{tail}"

    def groups(self) -> list[list[str]]:
        """Names in the order in which they end."""
        last = [[node.called for node in self.nodes if node.executable == kind] for kind in LAST]
        return [[node.called for node in self.nodes if node.executable not in LAST], *last]

    def stop(self) -> None:
        """SIGINT to what still runs, in order; each must end with exit code 0 within GRACE."""
        for group in self.groups():
            wrong = self.end(group)
            if wrong:
                raise GraphError(wrong[0])

    def kill(self) -> None:
        """End whatever is left, at once."""
        for process in self.processes.values():
            if process.poll() is None:
                process.kill()
            process.wait()
        for log in self._logs.values():
            log.close()


def run_composed(
    nodes: Sequence[NodeSpec],
    *,
    namespace: str = NAMESPACE,
    domain_id: int | None = None,
    lockstep: bool = True,
    until_signal: bool = False,
) -> None:
    """Run all nodes in this thread until the plant stops; the same result as separate processes in lock-step.

    With `until_signal` SIGINT and SIGTERM end it as orderly, and the process is this graph's alone.
    """
    graph = Graph(nodes, namespace=namespace, domain_id=domain_id, lockstep=lockstep)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with ros_context([], domain_id=domain_id) as context:
        loop = NodeLoop(context)
        if until_signal:
            obey_signals(loop)
        try:
            for node in sorted(graph.nodes, key=lambda one: one.executable in LAST):
                build = importlib.import_module(NODES[node.executable].module).build
                arguments = node.arguments(namespace, graph.extra(node))
                loop.add(build_node(build, node.executable, context, arguments))
            loop.run()
        finally:
            loop.close(TAKEN_DOWN if until_signal else math.inf)


def command(nodes: Sequence[NodeSpec], lockstep: bool) -> tuple[str, ...]:
    """The command line that runs these nodes."""
    content = {node.executable: dict(node.parameters) for node in nodes}
    return (sys.executable, "-m", "shake_ros.ros.graph", json.dumps({"lockstep": lockstep, "nodes": content}))


def main(arguments: Sequence[str]) -> int:
    """Run them; returns the exit code."""
    content: Mapping[str, Any] = json.loads(arguments[0])
    nodes = [NodeSpec(name, parameters) for name, parameters in content["nodes"].items()]
    try:
        run_composed(nodes, namespace=NAMESPACE, lockstep=content["lockstep"], until_signal=True)
    except ShakeError as error:
        print(f"shake_ros: {error}", file=sys.stderr)
        return 2
    return 0


SLOWEST = 50.0  # steps/s below which a run counts as stuck
STARTING = 300.0  # time that five processes may take to start, compiling on a slow and busy machine [s]


def free_domain() -> int:
    """A ROS domain of this process's own, unless the environment names one."""
    given = os.environ.get("ROS_DOMAIN_ID")
    return int(given) if given else 1 + os.getpid() % 100


def record(
    bag: Path,
    *,
    table: str,
    reference: str,
    observer: str,
    controller: str,
    seed: int,
    duration: float,
    progress: Callable[[float], None],
) -> None:
    """Run the closed loop as separate processes and record everything to a bag.

    Parameters
    ----------
    table, reference, observer, controller : configurations by name or path.
    seed : of the sensor noise.
    duration : of the run [s].
    progress : called with the part done, 0 … 1, estimated from the clock at the usual rate.

    Raises
    ------
    GraphError : a node died, or the run is stuck.
    """
    nodes = [
        NodeSpec("recorder", {"output": str(bag)}),
        NodeSpec("controller", {"controller": controller}),
        NodeSpec("reference_generator", {"reference": reference}),
        NodeSpec("plant", {"table": table, "seed": seed, "duration": duration}),
        NodeSpec("observer", {"observer": observer}),
    ]
    started = time.monotonic()
    usual, limit = 3.0 + duration, STARTING + duration * 1000.0 / SLOWEST
    with Graph(nodes, domain_id=free_domain()) as graph:
        graph.wait(limit, waiting=lambda: progress(min((time.monotonic() - started) / usual, 0.97)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
