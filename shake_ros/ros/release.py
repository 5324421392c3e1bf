"""The followed values given to observer and controller of the running graph, and taken back, by a thread of its own.

See `shake_ros.twin.release` for what is given when. The two nodes get it as their parameters: a file of the table that
they carry (`model`), gains and β. What they had before is remembered, and set again at the end.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import Parameters, ShakeError
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import Frame
from shake_ros.ros.graph_client import LiveGraph
from shake_ros.ros.live_table import WHOLE
from shake_ros.settings import load_table, load_variant, save_table
from shake_ros.twin.release import Release, for_table
from shake_ros.twin.twin import WATCHING, TwinWindow

STEP = 0.25  # between two changes of the loop [s]
FAMILIES: Mapping[str, Mapping[str, type[Parameters]]] = {"observer": OBSERVERS, "controller": CONTROLLERS}
FOLLOWS_LOAD = "the controller follows the load itself; start it without `load` to release followed values to it"


class ReleasedLoop:
    """Observer and controller of a graph with the numbers that they had when this was made.

    Parameters
    ----------
    graph : with both in it. names : of the followed values. file : table for which both were made.

    Raises
    ------
    ShakeError : one of them carries another table, or follows the load by itself.
    """

    def __init__(self, graph: LiveGraph, names: tuple[str, ...], file: TableParameters) -> None:
        if not graph.until(lambda: {*FAMILIES} <= {*graph.reports}, WHOLE):
            raise ShakeError("no observer and no controller report in this graph")
        self._graph, self._file, self._count = graph, file, 0
        self._folder = Path(tempfile.mkdtemp(prefix="shake_ros-release-"))
        self._before: dict[str, Parameters] = {}
        self._carried: dict[str, TableParameters] = {}
        if "load" in graph.get_names("controller") and graph.get("controller", "load") != [""]:
            raise ShakeError(FOLLOWS_LOAD)
        for node, family in FAMILIES.items():
            _, given = load_variant(node, str(graph.get(node, node)[0]), family)
            self._before[node] = graph.values(node, given)
            if model := getattr(self._before[node], "model", ""):
                self._carried[node] = carried = load_table(model)
                other = [n for n in names if carried.value(n) != file.value(n)]
                if other:
                    raise ShakeError(f"the {node} carries another table than the twin's: {', '.join(other)}")

    def give(self, changes: Mapping[str, float]) -> None:
        """Set what depends on the table, for the table with other values; ShakeError where a node refuses."""
        self._count += 1
        now = self._file.with_values(changes)
        for node, before in self._before.items():
            values: dict[str, Any] = for_table(before, self._file, now)
            if node in self._carried:
                path = self._folder / f"{node}_{self._count}.yaml"
                save_table(path, self._carried[node].with_values(changes), "As the twin follows it.")
                values["model"] = str(path)
            self._graph.set(node, values)

    def restore(self) -> None:
        """What was there before, where the nodes still are."""
        there = self._graph.node.get_node_names_and_namespaces()
        for node, before in self._before.items():
            if tuple(f"/{self._graph.reports[node].node}".rpartition("/")[::-2]) not in there:
                continue
            names = [*for_table(before, self._file, self._file), *(["model"] if node in self._carried else [])]
            self._graph.set(node, {name: getattr(before, name) for name in names})
        shutil.rmtree(self._folder, ignore_errors=True)


class Releasing:
    """Serves the parameter `release` of the node `twin`.

    Parameters
    ----------
    wanted : whether it is released.
    release : what is to be in the loop.
    file : the twin's table.
    newest : stamp up to which the table has been heard [ns].

    Attributes
    ----------
    sound : whether the newest window shows a sound table.
    """

    def __init__(
        self,
        frame: Frame,
        wanted: Callable[[], bool],
        release: Release,
        file: TableParameters,
        newest: Callable[[], int],
    ) -> None:
        self.frame, self.release, self.sound = frame, release, False
        self._wanted, self._file, self._newest = wanted, file, newest
        self._loop: ReleasedLoop | None = None
        self._refused = False
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="releasing", daemon=True)
        self._thread.start()

    def know(self, window: TwinWindow, sound: bool) -> None:
        """Take what a window shows, where no change so far is a fault or unexplained."""
        self.sound = sound and window.state == WATCHING
        names = self.release.know(window) if self.sound else ()
        if names and self._loop is not None:
            self._event(OK, f"released to the loop: {self.release.text(names)}")

    def end(self) -> None:
        """Take everything back, at once."""
        self._over.set()
        self._thread.join()

    def _event(self, level: int, text: str) -> None:
        """A line, and the same in the recording."""
        self.frame.say(level, text)
        self.frame.diagnostics.event("release", level, text, {**self.release.changes})

    def _run(self) -> None:
        graph = LiveGraph(self.frame.node.context, self.frame.node.get_namespace())
        last = self._newest()
        try:
            while not self._over.wait(STEP):
                now = self._newest()
                seconds, last = (now - last) * 1e-9, now
                on = self._wanted()
                self._refused &= on
                if seconds > 0.0 and not self._refused:
                    self._step(graph, seconds, on)
            if self._loop is not None:
                self._back("the twin ends; observer and controller have their own values again")
        except ShakeError as error:
            self._event(WARN, f"observer and controller keep what they were given: {error}")
        finally:
            graph.close()

    def _step(self, graph: LiveGraph, seconds: float, on: bool) -> None:
        """One step; where a node refuses, nothing more is given until the operator releases it anew."""
        try:
            if on and self._loop is None:
                self._loop = ReleasedLoop(graph, self.release.names, self._file)
                self._event(OK, f"released to the loop: {self.release.text(self.release.names)}")
            if self._loop is None or (on and not self.sound):
                return
            if self.release.step(seconds, on):
                self._loop.give(self.release.changes)
            elif not on:
                self._back("taken back; observer and controller have their own values again")
        except ShakeError as error:
            self._refused = True
            self._event(WARN, f"not released: {error}")

    def _back(self, text: str) -> None:
        assert self._loop is not None
        self._loop.restore()
        self._loop = None
        self._event(OK, text)
