"""The table of a running graph as `qualify --live` and `commission --live` use it.

The reference generator plays the drives, a recorder of its own records them, the interlock stays in force as the
laboratory has it. Nothing here enables a table that its operator has not enabled, and nothing resets it. Observer and
controller are exchanged while the pressure is off, and in real time the generator reads a motion then; what was set is
set back at the end.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.live_table import InterlockHeldError
from shake_ros.quantities import ShakeError
from shake_ros.recordings.reference_file import write_drive
from shake_ros.ros.conversions import SECOND
from shake_ros.ros.frame import FIRST_STAMP
from shake_ros.ros.graph import Graph, GraphError, NodeSpec
from shake_ros.ros.graph_client import TABLES, LiveGraph
from shake_ros.ros.interface import NAMESPACE, VALVE_COMMAND
from shake_ros.ros.loop import ros_context
from shake_ros.safety.causes import CAUSES, OFF, RUN, STAGES, InterlockParameters

Array = NDArray[np.float64]
LOOK = 6.0  # for a graph [s]
WHOLE = 15.0  # for all of its nodes, once one has reported [s]
STARTING = 60.0  # of the hydraulics, and of a stop in order [s]
SAYING = 1.0  # from the report of a hold to its words [s]
STALLED = 20.0  # the reference does not advance for so long: the graph stands [s]
CHOSEN = "interlock.configuration"  # the interlock's name, beside its parameters
STARTS = "starting", "waiting for the first command"
GENERATOR = "reference_generator"
NEEDED = GENERATOR, "observer", "controller"
ENABLING = "./shake ros2 service call /shake/enable std_srvs/srv/SetBool '{data: true}'"

RESETTING = "find its cause, then reset and enable it"


class GraphTable:
    """See `shake_ros.api.live_table.LiveTable`."""

    def __init__(self, graph: LiveGraph, folder: Path, domain: int) -> None:
        self.graph, self.folder, self._domain = graph, folder, domain
        self.table = self._find()
        report = graph.report(self.table)
        self.lockstep = report.values["mode"] == "lockstep"
        named = "table" if self.table == "plant" else "bridge"
        (name, interlock, rate) = graph.get(self.table, named, CHOSEN, "rate")
        self.sample_time = 1.0 / float(rate)
        what = f"simulated, {name}" if self.table == "plant" else f"hardware_bridge, {name}"
        self.words = f"live, {what}, {'lock-step' if self.lockstep else 'real time'}, interlock {interlock}"
        self._before: dict[str, dict[str, Any]] = {}  # node → what its parameters were
        self._played_so_far = 0
        self._off = False  # whether the pressure is off by what was asked here
        self.check()

    def _find(self) -> str:
        """Executable of the table of a graph that is whole."""
        graph = self.graph
        graph.until(lambda: graph.reports, LOOK)
        if graph.reports:
            graph.until(lambda: {*NEEDED} <= {*graph.reports} and {*TABLES} & {*graph.reports}, WHOLE)
        found = [name for name in TABLES if name in graph.reports]
        space = graph.node.get_namespace()
        if not graph.reports:
            raise ShakeError(f"no graph runs under {space} in ROS domain {self._domain}; ./shake lab starts one")
        lacking = [name for name in NEEDED if name not in graph.reports] + ([] if found else ["table"])
        if lacking:
            raise ShakeError(f"the graph under {space} in ROS domain {self._domain} has no {' and no '.join(lacking)}")
        return found[0]

    @property
    def loop(self) -> str:
        """Kinds of controller and observer."""
        reports = (self.graph.next_report(name) for name in ("controller", "observer"))
        return ", ".join(report.message.partition(":")[0] for report in reports)

    @property
    def _ready(self) -> bool:
        report = self.graph.report(self.table)
        return report.values.get("stage") == STAGES[RUN] and report.message.startswith("running")

    def check(self) -> None:
        """ShakeError where the table is not enabled, is held, has two commanders, or plays something."""
        graph = self.graph
        if graph.commanders > 1:
            topic = graph.node.resolve_topic_name(VALVE_COMMAND.name)
            raise ShakeError(f"two commanders: {graph.commanders} nodes publish on {topic}; end one of them")
        report = graph.next_report(self.table)
        if report.message.startswith(STARTS):
            graph.until(lambda: self._ready, STARTING)
        if not self._ready:
            cure = f"enable it: on the page, or {ENABLING}" if "not enabled" in report.message else RESETTING
            raise ShakeError(f"the table is not ready to move: {report.message}; {cure}")
        playing = graph.next_report(GENERATOR).message
        if playing.endswith(": running"):
            raise ShakeError(
                f"the reference is playing already ({playing}); wait for its end, or set its `play` to false"
            )

    def play(self, drive: Array, name: str) -> Path:
        """See `LiveTable`."""
        if not self._off:
            self.check()
        self._played_so_far += 1
        name = f"{self._played_so_far}_{name}"
        work = self.folder / f"drive_{name}"
        work.mkdir()
        reference = write_drive(work, work, drive, self.sample_time)
        bag = self.folder / name
        self._keep(GENERATOR, "reference", "repeat")
        self.graph.set(GENERATOR, {"play": False, "repeat": False})
        self.graph.next_report(GENERATOR)
        if not self.lockstep and not self._off:  # the generator is late while it reads a motion
            self._turn(False)
        self.graph.set(GENERATOR, {"reference": str(reference)})
        if self._off:
            self._turn(True)
        spec = NodeSpec("recorder", {"output": str(bag)}, name=f"recorder_of_{os.getpid()}")
        recorder = Graph(
            [spec], namespace=self.graph.node.get_namespace(), domain_id=self._domain, lockstep=self.lockstep
        )
        try:
            with recorder:
                recorder.wait_until_ready()
                held = self._played(recorder)
        except GraphError as error:
            raise ShakeError(f"{name}: {error}") from None
        if held:
            raise InterlockHeldError(f"{name}: the interlock held the table: {held}", held, bag)
        return bag

    def _played(self, recorder: Graph) -> str:
        """Play, and wait for the end; what the interlock says where it holds."""
        graph, trips = self.graph, len(self.graph.trips)
        graph.set(GENERATOR, {"play": True})
        report = graph.report(GENERATOR)
        place, moved = report.values.get("sample"), time.monotonic()
        held = ""
        while not held and not graph.report(GENERATOR).message.endswith(": ended"):
            graph.until(lambda: len(graph.trips) > trips, 0.2)
            recorder.check()
            if len(graph.trips) > trips or not self._ready:  # the table's report may come before what it acts on
                graph.until(lambda: len(graph.trips) > trips, SAYING)
                held = "; ".join(graph.trips[trips:]) or graph.report(self.table).message
            if (now := graph.report(GENERATOR).values.get("sample")) != place:
                place, moved = now, time.monotonic()
            elif time.monotonic() - moved > STALLED:
                raise ShakeError(f"the graph has stopped: no sample for {STALLED:g} s")
        end = int(graph.report(GENERATOR).values["sample"])
        graph.set(GENERATOR, {"play": False})
        self._wait_for(recorder, end)
        return held

    def _wait_for(self, recorder: Graph, end: int) -> None:
        """Until the recorder has what was played; in lock-step up to the sample `end`, as it may be far behind."""
        graph, (name,) = self.graph, (node.called for node in recorder.nodes)
        full = f"{graph.space}/{name}"
        period = round(self.sample_time * SECOND)
        needed = FIRST_STAMP + end * period if self.lockstep else 0
        for _ in range(2):  # the first may have been made before the end
            graph.next_report(full)
        if not graph.until(lambda: int(graph.reports[full].values.get("recorded_to_ns", 0)) >= needed, STALLED):
            raise ShakeError(f"{name} is more than {STALLED:g} s behind the table")

    def carry(self, observer: Path, controller: Path) -> None:
        """See `LiveTable`."""
        self._keep("observer", "observer")
        self._keep("controller", "controller")
        self._exchange(str(observer.resolve()), str(controller.resolve()))

    def _exchange(self, observer: str, controller: str) -> None:
        if not self._off:
            self._turn(False)
        self.graph.set("observer", {"observer": observer})
        self.graph.set("controller", {"controller": controller})

    def _turn(self, on: bool) -> None:
        """Pressure off, or on again."""
        graph, stage = self.graph, STAGES[OFF]
        graph.enable(on)
        reached = graph.until(
            lambda: self._ready if on else graph.report(self.table).values.get("stage") == stage, STARTING
        )
        if not reached:
            what = "run" if on else stage
            raise ShakeError(f"the table does not reach {what}: {graph.report(self.table).message}")
        self._off = not on

    def interlock(self) -> InterlockParameters:
        """See `LiveTable`."""
        names = [n for n in self.graph.get_names(self.table) if n.startswith("interlock.") and n != CHOSEN]
        content: dict[str, Any] = {"causes": {cause: {} for cause in CAUSES}}
        for name, value in zip(names, self.graph.get(self.table, *names), strict=True):
            *place, last = name.split(".")[1:]
            (content["causes"][place[1]] if place else content)[last] = value
        return InterlockParameters.from_mapping(content, self.graph.reports[self.table].node)

    def limit(self, thresholds: Mapping[str, float]) -> None:
        """See `LiveTable`."""
        values = {f"interlock.causes.{cause}.threshold": float(value) for cause, value in thresholds.items()}
        self._keep(self.table, *values)
        self.graph.set(self.table, values)

    def _keep(self, node: str, *names: str) -> None:
        """Remember what parameters were before they are set for the first time."""
        known = self._before.setdefault(node, {})
        new = [name for name in names if name not in known]
        if new:
            known |= zip(new, self.graph.get(node, *new), strict=True)

    def set_back(self) -> str:
        """All parameters as they were; says where the pressure stays off for it."""
        before, self._before = self._before, {}
        restored = ""
        if GENERATOR in before:
            self.graph.set(GENERATOR, {"play": False})
        if "controller" in before:
            self._exchange(before.pop("observer")["observer"], before.pop("controller")["controller"])
            restored = "observer and controller are restored; the pressure is off"
        for node, values in before.items():
            self.graph.set(node, values)
        return restored


@contextmanager
def live_table(namespace: str = NAMESPACE) -> Iterator[GraphTable]:
    """The table of the graph that runs in the ROS domain of the environment.

    Raises
    ------
    ShakeError : no graph, no enabled table, two commanders.
    """
    domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
    with tempfile.TemporaryDirectory(prefix="shake_ros-live-") as folder, ros_context([], domain_id=domain) as context:
        graph = LiveGraph(context, namespace)
        try:
            table = GraphTable(graph, Path(folder), domain)
            try:
                yield table
            finally:
                if restored := table.set_back():
                    print(restored, flush=True)
        finally:
            graph.close()
