"""The steps of `commission`: levels and limits from config/, what the operator reads, the interlock, the runs.

What is moved is a simulated table, or that of a running graph, each under the interlock of a level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.live_table import InterlockHeldError, LiveTable
from shake_ros.api.loops import load_controller, load_observer
from shake_ros.api.simulate import Simulation, simulate
from shake_ros.api.tune_table import TunedTable
from shake_ros.control.closed_loop import normalised_error
from shake_ros.control.linear_loop import LAWS
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import Parameters, ShakeError, quantity, unknown_name
from shake_ros.recordings.bags import TableRecording, read_table_recording
from shake_ros.recordings.reference_file import played
from shake_ros.safety.causes import PROGRAM_HOLD, InterlockParameters
from shake_ros.safety.rehearsal import WatchedRun, first_trip
from shake_ros.settings import find, load_content, read_yaml

KEYS = ("reference", "seconds", "levels", "search_from", "controller", "observer", "interlock", "laws", "numbers")
Array = NDArray[np.float64]
HELD = ("position_hard", "velocity", "acceleration", "tracking_error")  # limits that grow with the level


@dataclass(frozen=True)
class CommissionNumbers(Parameters):
    """Sample time and the limits of a level."""

    sample_time: float = quantity("s", "sample time", low=1e-5, high=0.1)
    margin: float = quantity("-", "limits over the largest values of the level's motion", low=1.0, high=10.0)
    least_position: float = quantity("m", "added to the limit of the position", low=0.0, high=1.0)
    least_velocity: float = quantity("m/s", "added to the limit of the velocity", low=0.0, high=10.0)
    least_acceleration: float = quantity("m/s^2", "added to the limit of the acceleration", low=0.0, high=1e3)
    distance: float = quantity("m", "from the reference at the first level; grows with the limits", low=1e-4, high=1.0)


@dataclass(frozen=True)
class CommissionSettings:
    """A file of config/commission.

    `search_from` : level from which `close_loop` seeks what the model lacks, in all runs so far; above 1 it never does.
    `tuning` : name or path of a file of config/robust_tuning.
    """

    reference: str
    seconds: float
    levels: tuple[float, ...]
    search_from: float
    controller: str
    observer: str
    interlock: str
    laws: tuple[str, ...]
    numbers: CommissionNumbers
    tuning: str = "default"


def load_commission(name: str) -> CommissionSettings:
    """config/commission/<name>.yaml, or a YAML file given by path.

    Raises
    ------
    ShakeError : unknown or missing keys, levels that do not grow to at most 1, an unknown law.
    """
    content, path = load_content("commission", name, (*KEYS, "tuning"), KEYS)
    try:
        levels, seconds = tuple(float(level) for level in content["levels"]), float(content["seconds"])
        search_from = float(content["search_from"])
    except (TypeError, ValueError):
        raise ShakeError(f"{path}: levels, seconds and search_from: expected numbers") from None
    if not levels or any(np.diff((0.0, *levels)) <= 0.0) or levels[-1] > 1.0 or not 1.0 < seconds < 1e4:
        raise ShakeError(f"{path}: levels {list(levels)} must grow from above 0 to at most 1, seconds be above 1")
    for law in content["laws"]:
        if law not in LAWS:
            raise unknown_name("law", law, LAWS, path)
    numbers = CommissionNumbers.from_mapping(content["numbers"], f"{path}: numbers")
    own = {"levels": levels, "seconds": seconds, "search_from": search_from, "numbers": numbers}
    return CommissionSettings(**{**content, **own, "laws": tuple(content["laws"])})


def interlock_of(settings: CommissionSettings, motion: Array, first: float) -> dict[str, Any]:
    """The interlock of a level as its YAML content: limits around its motion (n, 3), never beyond the outermost ones.

    `first` is the first level over this one. The causes that it holds at ramp the command to zero.
    """
    path, n = find("interlock", settings.interlock), settings.numbers
    content = read_yaml(path)
    outermost = InterlockParameters.from_mapping(content, str(path))
    least = n.least_position, n.least_velocity, n.least_acceleration
    wanted = (*(n.margin * np.max(np.abs(motion), axis=0) + least), n.distance / first)
    causes: dict[str, Any] = {name: dict(value) for name, value in content["causes"].items()}
    for name, value in zip(HELD, wanted, strict=True):
        limit = float(min(value, outermost.response(name).threshold))
        causes[name] |= {"threshold": float(f"{limit:.4g}"), "action": PROGRAM_HOLD}
    soft, hard = causes["position_soft"], causes["position_hard"]
    soft["threshold"] = min(soft["threshold"], hard["threshold"])
    return {**content, "causes": causes}


LEVEL = "interlock of the level"
UNITS = {"position_hard": "m", "velocity": "m/s", "acceleration": "m/s²", "tracking_error": "m"}


@dataclass(frozen=True)
class Step:
    """A run that was released, and what was concluded from it."""

    level: float  # part of the reference
    loop: str  # of the law
    limits: Mapping[str, float]  # of the interlock, by the names of `HELD`
    interlock: Mapping[str, Any]
    run: TableRecording  # whole, or up to where the interlock held
    error: tuple[float, float, float] | None  # of position, velocity, acceleration [-], of a whole run
    held: str = ""  # the interlock's reason for a hold, empty where there was none
    explained: float | None = None  # error of the fitted model's acceleration on the newest run [-]
    tuned: TunedTable | None = None  # observer and gains for the model that was fitted
    added: tuple[str, ...] = ()  # effects that close_loop found
    purpose: str = ""  # of a run that is not the first one of its level

    @property
    def findings(self) -> list[str]:
        """What was concluded from the run, a line each."""
        lines = []
        if self.explained is not None:
            missed = f"{100.0 * self.explained:.2f} % of this one's acceleration"
            lines.append(f"The model fitted to all earlier runs misses {missed}.")
        if self.added:
            lines.append(f"close_loop found in all runs: {', '.join(self.added)}.")
        if self.tuned is not None:
            lines.append(f"Gains for it: {self.tuned.best.kind}; {self.tuned.margins.text}.")
            lines += self.tuned.findings
        return lines


def watched(run: Simulation, content: Mapping[str, Any]) -> tuple[str, float]:
    """What the interlock would say to a run first, and when [s]; empty and the run's length where it lets it pass."""
    r, dt = run.recording, run.sample_time
    assert r.pressure_supply is not None and r.acceleration is not None and r.reference is not None
    assert r.valve_command is not None
    columns = r.position, r.acceleration, r.pressure_supply, r.valve_command, r.reference[:, 0]
    held = first_trip(
        InterlockParameters.from_mapping(content, LEVEL), WatchedRun(dt, *(c.tolist() for c in columns)), HELD
    )
    if held is None:
        return "", len(r.time) * dt
    trip, k = held
    return f"{trip.cause} {trip.value:.3g} beyond {trip.limit:.3g} at {k * dt:.3f} s", k * dt


def tracked(run: TableRecording) -> tuple[float, float, float]:
    """Errors of position, velocity and acceleration behind the reference [-].

    Of the true motion if it is known, otherwise of the measured one with the observer's velocity.
    """
    assert run.reference is not None
    motion = run.truth
    if motion is None:
        assert run.estimate is not None and run.acceleration is not None
        motion = np.column_stack([run.position, run.estimate[:, 1], run.acceleration])
    x, v, a = normalised_error(run.reference, motion).tolist()
    return x, v, a


def announced(
    number: int,
    level: float,
    motion: Array,
    loop: str,
    interlock: Mapping[str, Any],
    limited: Sequence[str],
    purpose: str,
) -> str:
    """What the operator reads before a run is released."""
    x, v, a = np.max(np.abs(motion), axis=0).tolist()
    limit = {name: float(interlock["causes"][name]["threshold"]) for name in HELD}
    distance = f", or {1e3 * limit['tracking_error']:.1f} mm from the reference" if "tracking_error" in limited else ""
    return (
        f"step {number + 1}, level {level:g}{', ' if purpose else ''}{purpose}: {1e3 * x:.1f} mm, {v:.3f} m/s, "
        f"{a:.2f} m/s²; gains: {loop}; the interlock holds beyond {1e3 * limit['position_hard']:.1f} mm, "
        f"{limit['velocity']:.3f} m/s, {limit['acceleration']:.2f} m/s²{distance}"
    )


NEEDED = HELD[:3]  # limits that a live interlock has to act on
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
            (load_observer(s.observer, dt), load_controller(s.controller, dt)) if tuned is None
            else tuned.loop(dt)
        )  # fmt: skip
        made = simulate(self.plant, motion, dt, controller=controller, observer=observer, delay=self.delay, seed=number)
        held, kept = watched(made, interlock)
        part = made.recording.between(0.0, kept) if held else made.recording
        return StageRun(replace(part, name=name), held)


@dataclass(frozen=True)
class LiveStage:
    """The table of a running graph; its interlock gets the limits of each level, its nodes the loop."""

    table: LiveTable
    settings: CommissionSettings
    outermost: dict[str, float]

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
