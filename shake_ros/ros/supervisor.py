"""Keeps the processes of `lab`: says who died and why, starts again on request, records, ends all in order.

In real time `--enabled` and `--play` begin when all nodes run, and no sooner.

Processes that start load the machine for some seconds, and an interlock that already watched its deadlines would trip
on that. What tripped so before any pressure was asked for is reset, once and with a line; anything else is left to the
operator. The reference plays when commands act, so that the table follows it from its first sample.
"""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from shake_ros.core.quantities import ShakeError
from shake_ros.core.safety.causes import TIMED
from shake_ros.page.desk import Exchange
from shake_ros.ros.graph import LAST, Graph, NodeSpec
from shake_ros.ros.graph_client import TABLES, LabWatch
from shake_ros.ros.interface import ENABLE, RESET

GENERATOR = "reference_generator"


class LabStart:
    """The first enabling of a graph, and the first `play`; both only as they are asked for.

    Parameters
    ----------
    watch : the lab's eyes.
    enable, play : what is asked for.
    """

    def __init__(self, watch: LabWatch, enable: bool, play: bool) -> None:
        self._watch = watch
        self._wanted = [*([self._enable, self._wait] if enable else []), *([self._play] if play else [])]
        self._reset_done = False
        self._future: Any = None
        node = watch.node
        self._services: dict[str, Any] = {
            one.name: node.create_client(one.type, one.name) for one in (ENABLE, RESET) if enable
        }
        self._generator = AsyncParameterClient(node, GENERATOR) if play else None

    def go_on(self) -> str:
        """One step of it, without waiting; what there is to say, empty for nothing."""
        return self._wanted[0]() if self._wanted else ""

    def _ask(self, service: Any, name: str) -> Any:
        """Answer of a service; None while there is none."""
        if self._future is None and self._services[name].service_is_ready():
            self._future = self._services[name].call_async(service)
        return self._answer()

    def _answer(self) -> Any:
        if self._future is None or not self._future.done():
            return None
        answer, self._future = self._future.result(), None
        return answer

    def _enable(self) -> str:
        answer = self._ask(ENABLE.type.Request(data=True), ENABLE.name)
        if answer is None:
            return ""
        if answer.success:
            self._wanted.pop(0)
            return ""
        if not self._reset_done and self._watch.tripped <= {*TIMED}:
            self._reset_done = True
            self._wanted.insert(0, self._reset)
            return f"tripped while the nodes started: {answer.message}"
        self._wanted.clear()
        return f"not enabled: {answer.message}"

    def _reset(self) -> str:
        answer = self._ask(RESET.type.Request(), RESET.name)
        if answer is None:
            return ""
        self._wanted.pop(0)
        return "reset, before any pressure" if answer.success else f"reset refused: {answer.message}"

    def _wait(self) -> str:
        if not self._watch.acts:
            return ""
        self._wanted.pop(0)
        return "commands act"

    def _play(self) -> str:
        assert self._generator is not None
        if self._future is None and self._generator.services_are_ready():
            self._future = self._generator.set_parameters([Parameter("play", value=True)])
        answer = self._answer()
        if answer is None:
            return ""
        self._wanted.pop(0)
        result = answer.results[0]
        return "" if result.successful else f"{GENERATOR}: {result.reason or 'play refused'}"


POLL = 0.05  # [s]
SIGNAL_REPEAT = 2.0  # a signal that comes later than this after the first ends all at once [s]
STOPPING = 12.0  # an orderly stop may take so long [s]
COMPILING = 4.0  # a start that takes longer says why [s]
OUTSIDE = ("page", *LAST)  # do not take part in the loop


def say(text: str) -> None:
    """A line on the lab's console."""
    print(f"lab: {text}", flush=True)


class Supervisor:
    """One laboratory.

    Parameters
    ----------
    graph : of its processes, not yet started.
    watch : its eyes.
    start : what it begins once all run.
    exchange : the line to the page.
    recordings : their folder.
    """

    def __init__(self, graph: Graph, watch: LabWatch, start: LabStart, exchange: Exchange, recordings: Path) -> None:
        self.graph, self.watch, self.start, self.exchange, self.recordings = graph, watch, start, exchange, recordings
        self._asked = 0.0  # when it was asked to stop, on the monotonic clock [s]
        self._dead: dict[str, str] = {}  # node → why
        self._published: dict[str, Any] = {}  # what the page knows
        self._reader = sys.stdin if sys.stdin is not None and sys.stdin.isatty() else None
        self._ready = False
        self._missing = ""  # the target computer, as was last said

    def ask_to_stop(self) -> None:
        """End in order; at once where that was asked for before."""
        now = time.monotonic()
        if self._asked and now - self._asked > SIGNAL_REPEAT:
            self.graph.kill()
            say("killed")
            raise SystemExit(1)
        self._asked = self._asked or now

    def run(self) -> int:
        """Until a signal, or until the table has ended by itself; returns the exit code."""
        started = time.monotonic()
        self.graph.start()
        slow = False
        while not self._asked and not self._done():
            self._look()
            self._serve()
            if not self._ready and not slow and time.monotonic() - started > COMPILING:
                slow = True
                say("compiling, as at every first start; this may take a minute")
        return self._end()

    def _done(self) -> bool:
        return any(self.graph.processes[one.called].poll() == 0 for one in self._loop() if one.executable in TABLES)

    def _loop(self) -> list[NodeSpec]:
        return [one for one in self.graph.nodes if one.executable not in OUTSIDE]

    def _recorder(self) -> str:
        """Output of the recorder that runs; empty where none does."""
        running = [one for one in self.graph.nodes if one.executable in LAST and self._runs(one.called)]
        return str(running[0].parameters["output"]) if running else ""

    def _runs(self, name: str) -> bool:
        return self.graph.processes[name].poll() is None

    def _look(self) -> None:
        """Who has died, and whether all are there."""
        for node in self.graph.nodes:
            name = node.called
            if self._runs(name) or name in self._dead:
                continue
            if node.executable in (*LAST, *TABLES) and self.graph.processes[name].poll() == 0:
                continue
            code, written = self.graph.processes[name].poll(), self.graph.output(name).strip().splitlines()
            why = written[-1] if written and code and code > 0 else "ended"
            self._dead[name] = f"killed by signal {-code}" if code and code < 0 else f"exit code {code}: {why}"
            say(f"{name} died, {self._dead[name]}")
            say(f"to start it again: {name} and Enter" if self._reader else f"{name} can be started again on the page")
        wanted = {one.executable for one in self._loop()}
        if not self._ready and not self._dead and wanted <= self.watch.heard:
            self._ready = bool(self.watch.stage)
            if self._ready:
                say(f"running: {', '.join(one.called for one in self.graph.nodes)}")
        all_there = {one.executable for one in self.graph.nodes if one.called not in self._dead} <= self.watch.heard
        if self._ready and all_there and (text := self.start.go_on()):
            say(text)
        while self.watch.trips:
            say(f"interlock: {self.watch.trips.pop(0)}")
        if self.watch.missing != self._missing:
            self._missing = self.watch.missing
            say(f"hardware_bridge: {self._missing or 'the target answers'}")
        self._publish_state()

    def _publish_state(self) -> None:
        """Inform the page of a change."""
        there = [one.called for one in self.graph.nodes if self._runs(one.called) or one.called in self._dead]
        states = {name: self._dead.get(name, "") for name in there}
        now = {"processes": states, "recording": self._recorder()}
        if now != self._published:
            self._published = now
            self.exchange.send({"event": "processes", **now})

    def _serve(self) -> None:
        """What the page and the terminal ask for."""
        self.watch.spin(POLL)
        for message in self.exchange.take():
            self._answer(message)
        if self._reader and select.select([self._reader], [], [], 0)[0]:
            line = self._reader.readline()
            if not line:
                self._reader = None
            elif line.strip():
                self._answer({"do": "restart", "name": line.strip()})

    def _answer(self, message: Mapping[str, Any]) -> None:
        acts = {"restart": self._restart, "record": self._record, "stop_recording": self._stop_recording,
                "table": self._other_table, "address": self._address}  # fmt: skip
        try:
            text = acts[message["do"]](message)
            done = True
        except (ShakeError, OSError) as error:
            text, done = str(error), False
        if text:
            say(text)
        if message["do"] == "address":
            self._published = {}
        self.exchange.send({"event": "answer", "id": message.get("id"), "ok": done, "text": text})

    def _address(self, message: Mapping[str, Any]) -> str:
        return f"open {message['url']}"

    def _restart(self, message: Mapping[str, Any]) -> str:
        """One node; in lock-step the whole loop, since all count the same samples."""
        name = message["name"]
        known = [one.called for one in self.graph.nodes if one.executable not in LAST]
        if name not in known:
            raise ShakeError(f"no node {name}; there are {', '.join(known)}")
        if self.graph.lockstep and name in (one.called for one in self._loop()):
            return self._restart_loop()
        if self._runs(name):
            self.graph.end([name])
        self.graph.start_again(name)
        self._dead.pop(name, None)
        return f"{name} started again"

    def _stop_in_order(self, broken: float) -> bool:
        """Whether the table has said that its pressure is off; `broken`: timeout where a node has died [s]."""
        if self._dead:
            return self.watch.stop_in_order(broken)
        return self.watch.stop_in_order(STOPPING, self._say_slow if self.graph.lockstep else None)

    def _say_slow(self) -> None:
        say("the table is slow here, and so is its stop; Ctrl-C again ends it at once")

    def _restart_loop(self) -> str:
        """All nodes of the loop, behind an orderly stop; a recording ends with it."""
        self._stop_in_order(POLL)
        loop = [one.called for one in self._loop()]
        self.graph.end([name for name in loop if self._runs(name)])
        self._stop_recording({})
        for name in loop:
            self.graph.start_again(name)
            self._dead.pop(name, None)
        return f"started again: {', '.join(loop)}"

    def _other_table(self, message: Mapping[str, Any]) -> str:
        """The simulated table with another configuration."""
        plant = next((one for one in self.graph.nodes if one.executable == "plant"), None)
        if plant is None or plant.program:
            raise ShakeError("there is no simulated table in a process of its own here")
        self._stop_in_order(POLL)
        other = NodeSpec("plant", {**plant.parameters, "table": message["name"]})
        self.graph.nodes = [other if one is plant else one for one in self.graph.nodes]
        if self.graph.lockstep:
            return self._restart_loop()
        return self._restart({"name": "plant"})

    def _record(self, message: Mapping[str, Any]) -> str:
        path = self.recordings / Path(message["name"]).name
        if running := self._recorder():
            raise ShakeError(f"already recording to {running}")
        if path.exists():
            raise ShakeError(f"{path.name}: exists already; choose another name")
        self._dead.pop("recorder", None)
        self.graph.add(NodeSpec("recorder", {"output": str(path)}))
        return f"recording to {path}"

    def _stop_recording(self, _message: Mapping[str, Any]) -> str:
        running = self._recorder()
        if not running:
            return ""
        wrong = self.graph.end([one.called for one in self.graph.nodes if one.executable in LAST])
        if wrong:
            raise ShakeError(wrong[0])
        return f"recording closed: {running}"

    def _end(self) -> int:
        """Hold, pressure off, nodes, recorder, page."""
        wrong = []
        if self._asked:
            say("stopping: hold, pressure off")
            if not self._stop_in_order(SIGNAL_REPEAT):
                wrong.append("the table has not reported that its pressure is off")
        recording = self._recorder()
        for group in (
            [one.called for one in self._loop()],
            [one.called for one in self.graph.nodes if one.executable in LAST],
            [one.called for one in self.graph.nodes if one.executable == "page"],
        ):
            wrong += self.graph.end([name for name in group if self._runs(name)])
        if recording:
            say(f"recording closed: {recording}")
        for line in wrong:
            say(line)
        say("ended" if not wrong and not self._dead else "stopped, with losses")
        return 1 if wrong or self._dead else 0
