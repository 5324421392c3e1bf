"""What `qualify` and `commission` ask of the table of a running graph, and the loop that is made for a table.

shake_ros/ros/live_table.py has the live table over ROS.

A table's own loop has gains that `tune` makes for it, and an observer that takes the accelerometer. Gains made for
another table ring on one with a softer zone, and the acceleration that an observer makes of a position with 8 µm of
noise does not damp such a zone: both showed on the tables bergamo_measured and bergamo_table_6_9 (`python -m
benchmarks.qualification.iterate_defaults`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.tune_table import text_of, tune_table
from shake_ros.control.laws.law import LawParameters
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.law import ObserverParameters
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.parameters import DELAY, TableParameters
from shake_ros.quantities import Parameters, ShakeError
from shake_ros.recordings.bags import TableRecording, read_table_recording
from shake_ros.recordings.reference_file import played
from shake_ros.safety.causes import InterlockParameters
from shake_ros.settings import load_variant, save_table

OWN = "own"  # in place of the name of a controller or an observer
LAW = "three_variable"  # acts on the error alone, so that what an integral has gathered does not outlast a run
FUSED = "fused_accelerometer"
MODEL_BANDWIDTH = 200.0  # rad/s, of the virtual table: with tune's 100 it misses twice as much of the motion by itself
SAME = ("beta1", "beta2", "beta3", "beta4", "beta5", "position_noise", "jerk_noise", "disturbance_noise", "predict")


@dataclass(frozen=True)
class OwnLoop:
    """Parameters of observer and controller for a table, whatever model they carry."""

    observer: ObserverParameters
    kind: str  # of the law
    law: LawParameters
    sound: bool  # whether it rings on no neighbour of the table

    def late(self, model: TableParameters, late: float) -> OwnLoop:
        """The loop with its dead time [s], which a fitted model with a delay knows by itself."""
        known = {"loop_delay": 0.0 if model.value(DELAY) > 0.0 else late}
        return replace(self, observer=self.observer.replace(**known), law=self.law.replace(**known))

    def of(self, model: TableParameters, sample_time: float, late: float) -> tuple[Observer, Controller]:
        """Observer and controller with a model; `late` as of the method."""
        loop = self.late(model, late)
        observer = Observer("fused", loop.observer, sample_time, model)
        return observer, Controller(loop.kind, loop.law, sample_time, model)


_loops: dict[str, OwnLoop] = {}  # made in this process, by the values of their tables


def own_loop(table: TableParameters) -> OwnLoop:
    """The loop of a table, in some seconds, later at once; ShakeError where none can be made."""
    values = f"{table.layout.name} {table.to_mapping()}"
    if values not in _loops:
        _loops[values] = _made_for(table)
    return _loops[values]


def _made_for(table: TableParameters) -> OwnLoop:
    tuned = tune_table(table, laws=[LAW], progress=False)
    parameters: ObserverParameters
    _, parameters = load_variant("observer", FUSED, OBSERVERS)
    observer = parameters.replace(**{name: getattr(tuned.observer, name) for name in SAME})
    law = tuned.best.parameters.replace(model_bandwidth=MODEL_BANDWIDTH)
    return OwnLoop(observer, tuned.best.kind, law, tuned.sound)


Array = NDArray[np.float64]
Release = Callable[[str], str]  # called with what will move the table; returns who releases it, empty where nobody does


class NotReleasedError(ShakeError):
    """Nobody let a live table move."""


class InterlockHeldError(ShakeError):
    """The interlock held the table while a drive was played.

    Attributes
    ----------
    cause : its words.
    bag : what was recorded up to there.
    """

    def __init__(self, text: str, cause: str, bag: Path) -> None:
        super().__init__(text)
        self.cause, self.bag = cause, bag


class LiveTable(Protocol):
    """The table of a running graph with its loop, the interlock in force, enabled by its operator."""

    @property
    def words(self) -> str:
        """Table, way of running and interlock, for a certificate."""

    @property
    def loop(self) -> str:
        """Controller and observer as they run."""

    @property
    def sample_time(self) -> float:
        """Of the graph [s]."""

    @property
    def folder(self) -> Path:
        """Where recordings are made and files for the nodes lie while it is used."""

    def check(self) -> None:
        """ShakeError where the table is not enabled, is held, or has two commanders."""

    def play(self, drive: Array, name: str) -> Path:
        """Play a drive (n, 3) [m], [m/s], [m/s²]; the recording. InterlockHeldError where the interlock holds."""

    def carry(self, observer: Path, controller: Path) -> None:
        """Another observer and controller, exchanged while the pressure is off; it comes on again for the next run."""

    def limit(self, thresholds: Mapping[str, float]) -> None:
        """Other limits of the interlock, by cause."""

    def interlock(self) -> InterlockParameters:
        """The interlock as it acts now."""


def write_loop(
    folder: Path,
    model: TableParameters,
    observer: tuple[str, Parameters],
    controller: tuple[str, Parameters],
) -> tuple[Path, Path]:
    """table.yaml, observer.yaml and controller.yaml of a loop that carries a model; the paths of the latter two."""
    folder.mkdir(parents=True)
    table = folder / "table.yaml"
    save_table(table, model, "The model of observer and controller.")
    paths = folder / "observer.yaml", folder / "controller.yaml"
    for path, (kind, parameters) in zip(paths, (observer, controller), strict=True):
        carried = parameters.replace(model=str(table.resolve()))
        path.write_text(text_of(kind, carried, ["For table.yaml in this folder."]), encoding="utf-8")
    return paths


@dataclass
class LiveLaboratory:
    """A `Laboratory` on the table of a running graph."""

    table: LiveTable
    # the loop made for a model, handed to the nodes with each other model; None leaves theirs
    own: OwnLoop | None = None
    late: float = 0.0  # dead time of the feedback, for a model without one [s]
    recordings: list[TableRecording] = field(default_factory=list)
    missing: dict[str, int] = field(default_factory=dict)  # samples filled in, by run
    _carried: TableParameters | None = None
    _loops: int = 0

    @property
    def words(self) -> str:
        """Its loop, for the certificate."""
        made = "" if self.own is None else ", gains made for the model"
        warning = "" if self.own is None or self.own.sound else ", which oscillate on a neighbour of it"
        return f"{self.table.loop}{made}{warning}"

    @property
    def remarks(self) -> dict[str, str]:
        """Samples that were put in, for the certificate."""
        put_in = ", ".join(f"{name}: {count}" for name, count in self.missing.items())
        return {"samples filled in linearly": put_in} if put_in else {}

    def carry(self, model: TableParameters) -> None:
        """Hand the own loop with this model to the nodes, where it is not there yet."""
        if self.own is None or model == self._carried:
            return
        loop = self.own.late(model, self.late)
        self._loops += 1
        folder = self.table.folder / f"loop_{self._loops}"
        self.table.carry(*write_loop(folder, model, ("fused", loop.observer), (loop.kind, loop.law)))
        self._carried = model

    def play(self, model: TableParameters, drive: Array, name: str, _number: int) -> TableRecording:
        """One recorded run of a drive; the noise is the table's own."""
        self.carry(model)
        found = played(read_table_recording(self.table.play(drive, name)), drive, self.table.sample_time, name)
        if found.missing:
            self.missing[name] = found.missing
        self.recordings.append(replace(found.recording, name=name))
        return self.recordings[-1]
