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
from collections.abc import Callable, Generator, Iterator, Mapping
from pathlib import Path
from typing import Any

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from shake_ros.page.desk import Exchange
from shake_ros.quantities import ShakeError
from shake_ros.ros.diagnostics import NO_ANSWER
from shake_ros.ros.graph import LAST, RECORDER, Graph, NodeSpec
from shake_ros.ros.graph_client import POLL, TABLES, LiveGraph
from shake_ros.ros.interface import ENABLE, RESET, Service
from shake_ros.safety.causes import OFF, STAGES, TIMED

GENERATOR = "reference_generator"
SLOW = 5.0  # an orderly stop that takes longer is explained [s]


def begin(live: LiveGraph, enable: bool, play: bool) -> Iterator[str]:
    """The first enabling of a graph, and the first `play`; yields what there is to say, empty while it waits."""
    if enable:
        answer = yield from _called(live, ENABLE, ENABLE.type.Request(data=True))
        if not answer.success and _tripped(live) <= {*TIMED}:
            yield f"tripped while the nodes started: {answer.message}"
            reset = yield from _called(live, RESET, RESET.type.Request())
            yield "reset, before any pressure" if reset.success else f"reset refused: {reset.message}"
            answer = yield from _called(live, ENABLE, ENABLE.type.Request(data=True))
        if not answer.success:
            yield f"not enabled: {answer.message}"
            return
        yield from _act(live)
        yield "commands act"
    if play:
        client = AsyncParameterClient(live.node, GENERATOR)
        while not client.services_are_ready():
            yield ""
        answer = yield from _answered(client.set_parameters([Parameter("play", value=True)]))
        result = answer.results[0]
        yield "" if result.successful else f"{GENERATOR}: {result.reason or 'play refused'}"


def _called(live: LiveGraph, service: Service, request: Any) -> Generator[str, None, Any]:
    client = live.services[service.name]
    while not client.service_is_ready():
        yield ""
    return (yield from _answered(client.call_async(request)))


def _answered(future: Any) -> Generator[str, None, Any]:
    while not future.done():
        yield ""
    return future.result()


def _tripped(live: LiveGraph) -> set[str]:
    """Causes that the interlock has acted on since its node started."""
    return {one.partition(":")[0] for one in live.of_table("trips").split()}


def _act(live: LiveGraph) -> Iterator[str]:
    """Until commands pass, with a master gain that rises no more from one report to the next."""
    gain, newest = live.of_table("span"), live.table
    while True:
        if live.table is not newest:
            newest, before, gain = live.table, gain, live.of_table("span")
            if live.of_table("passes") == "True" and gain == before and float(gain) > 0.0:
                return
        yield ""


def stop_in_order(live: LiveGraph, timeout: float, slowly: Callable[[], None] | None = None) -> bool:
    """A hold, then the pressure off; whether the table said so within `timeout` [s].

    With `slowly` (lock-step, which a busy machine runs at a fraction of real time) the timeout begins anew with
    every sample that the table takes; it is called once, where the stop takes longer than that of a quick table.
    """
    begun = since = time.monotonic()
    asked = reported = False
    cycles = live.of_table("cycles")
    while live.of_table("stage") not in ("", STAGES[OFF]) and time.monotonic() - since < timeout:
        if not asked and live.services[ENABLE.name].service_is_ready():
            live.services[ENABLE.name].call_async(ENABLE.type.Request(data=False))
            asked = True
        live.spin(POLL)
        if slowly and live.of_table("cycles") != cycles:
            since, cycles = time.monotonic(), live.of_table("cycles")
            if not reported and since - begun > SLOW:
                reported = True
                slowly()
    return live.of_table("stage") in ("", STAGES[OFF])


SIGNAL_REPEAT = 2.0  # a signal that comes later than this after the first ends all at once [s]
STOPPING = 12.0  # an orderly stop may take so long [s]
COMPILING = 4.0  # a start that takes longer says why [s]


def say(text: str) -> None:
    """A line on the lab's console."""
    print(f"lab: {text}", flush=True)


class Supervisor:
    """One laboratory: its processes, not yet started, and what it begins once all run, a step at a time (`begin`)."""

    def __init__(
        self, graph: Graph, live: LiveGraph, start: Iterator[str], exchange: Exchange, recordings: Path
    ) -> None:
        self.graph, self.live, self.start, self.exchange, self.recordings = graph, live, start, exchange, recordings
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
        return [one for one in self.graph.nodes if one.executable not in LAST]

    def _recorder(self) -> str:
        """Output of the recorder that runs; empty where none does."""
        running = [one for one in self.graph.nodes if one.executable == RECORDER and self._runs(one.called)]
        return str(running[0].parameters["output"]) if running else ""

    def _runs(self, name: str) -> bool:
        return self.graph.processes[name].poll() is None

    def _look(self) -> None:
        """Who has died, and whether all are there."""
        for node in self.graph.nodes:
            name = node.called
            if self._runs(name) or name in self._dead:
                continue
            if node.executable in (RECORDER, *TABLES) and self.graph.processes[name].poll() == 0:
                continue
            code, written = self.graph.processes[name].poll(), self.graph.output(name).strip().splitlines()
            why = written[-1] if written and code and code > 0 else "ended"
            self._dead[name] = f"killed by signal {-code}" if code and code < 0 else f"exit code {code}: {why}"
            say(f"{name} died, {self._dead[name]}")
            say(f"to start it again: {name} and Enter" if self._reader else f"{name} can be started again on the page")
        wanted = {one.executable for one in self._loop()}
        if not self._ready and not self._dead and wanted <= {*self.live.reports}:
            self._ready = bool(self.live.of_table("stage"))
            if self._ready:
                say(f"running: {', '.join(one.called for one in self.graph.nodes)}")
        all_there = {one.executable for one in self.graph.nodes if one.called not in self._dead} <= {*self.live.reports}
        if self._ready and all_there and (text := next(self.start, "")):
            say(text)
        while self.live.trips:
            say(f"interlock: {self.live.trips.pop(0)}")
        message = self.live.table.message if self.live.table else ""
        missing = message if message.startswith(NO_ANSWER) else ""
        if missing != self._missing:
            self._missing = missing
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
        self.live.spin(POLL)
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
        known = [one.called for one in self.graph.nodes if one.executable != RECORDER]
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
            return stop_in_order(self.live, broken)
        return stop_in_order(self.live, STOPPING, self._say_slow if self.graph.lockstep else None)

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
        wrong = self.graph.end([one.called for one in self.graph.nodes if one.executable == RECORDER])
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
        for group in self.graph.groups():
            wrong += self.graph.end([name for name in group if self._runs(name)])
        if recording:
            say(f"recording closed: {recording}")
        for line in wrong:
            say(line)
        say("ended" if not wrong and not self._dead else "stopped, with losses")
        return 1 if wrong or self._dead else 0
