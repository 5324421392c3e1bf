"""What a commissioning moves: a simulated table, or that of a running graph, each under the interlock of a level."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.live_table import InterlockHeldError, LiveTable
from shake_ros.api.simulate import controller_of, observer_of, simulate
from shake_ros.api.tune_table import TunedTable
from shake_ros.commissioning.steps import HELD, CommissionSettings, watched
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import TableRecording, read_table_recording
from shake_ros.data.reference_file import played
from shake_ros.settings import find

Array = NDArray[np.float64]
NEEDED = ("position_hard", "velocity", "acceleration")  # limits that a live interlock has to act on
SOFT = "position_soft"


class StageRun(NamedTuple):
    """A run, whole or up to where the interlock held, and what that said; empty where it did not."""

    recording: TableRecording
    held: str


class CommissionStage(Protocol):
    """What plays a motion under a loop and the interlock of a level."""

    @property
    def limited(self) -> tuple[str, ...]:
        """The causes whose limits grow with the level."""

    @property
    def words(self) -> str:
        """What is to be said before each run beside its size and limits; empty or from a semicolon on."""

    def within(self, interlock: dict[str, Any]) -> dict[str, Any]:
        """The interlock of a level, never beyond what holds here."""

    def run(
        self, motion: Array, tuned: TunedTable | None, interlock: Mapping[str, Any], name: str, number: int
    ) -> StageRun:
        """One run; `tuned` None is the first loop."""


@dataclass(frozen=True)
class SimulatedStage:
    """A simulated table, its commands some samples late."""

    plant: TableParameters
    settings: CommissionSettings
    delay: int
    limited: tuple[str, ...] = HELD
    words: str = ""

    def within(self, interlock: dict[str, Any]) -> dict[str, Any]:
        """As it is."""
        return interlock

    def run(
        self, motion: Array, tuned: TunedTable | None, interlock: Mapping[str, Any], name: str, number: int
    ) -> StageRun:
        """One run; what the interlock would have said to it."""
        s, dt = self.settings, self.settings.numbers.sample_time
        observer, controller = (
            (observer_of(s.observer, dt, None), controller_of(s.controller, dt, None)) if tuned is None
            else tuned.loop(dt)
        )  # fmt: skip
        made = simulate(self.plant, motion, dt, controller=controller, observer=observer, delay=self.delay, seed=number)
        held, kept = watched(made, interlock)
        part = made.recording.between(0.0, kept) if held else made.recording
        return StageRun(replace(part, name=name), held)


@dataclass
class LiveStage:
    """The table of a running graph; its interlock gets the limits of each level, its nodes the loop."""

    table: LiveTable
    settings: CommissionSettings
    outermost: dict[str, float]
    loops: int = 0

    @classmethod
    def on(cls, table: LiveTable, settings: CommissionSettings, changes: Mapping[str, float]) -> LiveStage:
        """On this table; ShakeError where its interlock does not act, or the asked values are a simulated table's."""
        if changes:
            raise ShakeError(f"set {', '.join(changes)}: values of the simulated table; a live one has its own")
        dt = settings.numbers.sample_time
        if abs(table.sample_time - dt) > 1e-9:
            raise ShakeError(f"live: a sample every {table.sample_time:g} s, config/commission has one every {dt:g} s")
        limits = table.interlock().limits
        if silent := [cause for cause in NEEDED if cause not in limits]:
            raise ShakeError(f"{table.words}: the interlock has no action on {', '.join(silent)}")
        return cls(table, settings, limits)

    @property
    def limited(self) -> tuple[str, ...]:
        """Those on which this interlock acts."""
        return tuple(cause for cause in HELD if cause in self.outermost)

    @property
    def words(self) -> str:
        """That the loop is exchanged."""
        return f"; {self.table.words}: the pressure goes off while observer and controller are exchanged, and on again"

    def within(self, interlock: dict[str, Any]) -> dict[str, Any]:
        """Never beyond what the laboratory's interlock had at the start."""
        causes = {name: dict(value) for name, value in interlock["causes"].items()}
        for cause, most in self.outermost.items():
            if cause in (*HELD, SOFT):
                causes[cause]["threshold"] = min(causes[cause]["threshold"], most)
        return {**interlock, "causes": causes}

    def run(
        self, motion: Array, tuned: TunedTable | None, interlock: Mapping[str, Any], name: str, number: int
    ) -> StageRun:
        """One run on the graph."""
        if tuned is None:
            paths = find("observer", self.settings.observer), find("controller", self.settings.controller)
        else:
            folder = tuned.write(self.table.folder / f"gains_{number}")
            paths = folder / "observer.yaml", folder / "controller.yaml"
        limits = {cause: interlock["causes"][cause]["threshold"] for cause in self.outermost if cause in (*HELD, SOFT)}
        self.table.carry(*paths)
        self.table.limit(limits)
        try:
            bag = self.table.play(motion, name)
        except InterlockHeldError as held:
            return StageRun(replace(read_table_recording(held.bag), name=name), held.cause)
        return StageRun(played(read_table_recording(bag), motion, self.table.sample_time, name).recording, "")
