"""Recordings as a fit sees them, and the models whose free runs over them are compared (chapter 4, 6.3.3.2).

Velocity is the zero-phase filtered derivative of the measured position. Volumes and position-dependent effects follow
the measured position. What the state was when the recording began shows in its first half second: a run of the full
model is corrected to the measured motion there, and free from then on. The error over several recordings is that of
recording_problem.py.
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, final

import numpy as np

from shake_ros.physics.plant.integration import FIRST_RATE
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableLayout, TableParameters
from shake_ros.physics.plant.simulation import (
    COLUMNS,
    NOTHING,
    SMOOTH,
    UNSEEN,
    initial_state,
    remember,
    run,
    run_batch,
)
from shake_ros.physics.plant.states import CLOCK, SPECIMEN, SPECIMEN_RATE, VELOCITY
from shake_ros.quantities import ShakeError
from shake_ros.signals.noise import periodic_deviation, resolution, white_deviation
from shake_ros.signals.stretches import energies
from shake_ros.signals.velocity_filter import derivative, low_pass, velocity_noise_gain, with_gains

SHORTEST = 1.0  # a part of a recording that is shorter than this tells nothing of the dynamics [s]
SETTLE = 0.5  # start of a recording that is simulated but not compared [s]: pressures are not known there …
AT_REST = 0.01  # … and found by correcting the run towards the motion, unless it rests at first: over this time [s] …
QUIET = 4.0  # … its velocity is below so many times its noise
SETTING_OUT = 0.1  # part of its root mean square below which a recording sets out from rest without noise
OVER = 0.8  # of the samples that a band needs where a filter ended at its highest frequency at once
LONGER = 3.0
MODEL_FLOOR = 2e-3  # part of a channel's rms that counts as noise at least
TRANSDUCER_CLASS = 0.01  # the same of a pressure: gain and linearity of common transducers
SWAY, SWAY_MOST = 1e-3, 100.0  # of a specimen: that is tried [m], and at most, over the motion of its table
SWAY_STEPS, SWAY_FOUND = 6, 0.03  # in which it is found, and part of it by which the last one changes it
SPECIMEN_MASS, SPECIMEN_FREQUENCY = (
    FULL_LAYOUT.index[f"effects.specimen_resonance.{n}"] for n in ("mass", "frequency")
)
MOTION, CHAMBERS = (1, 2), (COLUMNS.index("pressure_a"), COLUMNS.index("pressure_b"))


@dataclass(frozen=True)
class ExplainedBand:
    """Where the command explains the response, see nuisances/explained_band.py.

    highest : frequency of it [Hz]. beyond : standard deviation of the acceleration above [m/s²].
    left : standard deviation of what it leaves there of velocity [m/s], acceleration [m/s²] and, where it was
    measured, load pressure [Pa]. lines : frequencies [Hz], shape (k,). whitening : gains at these by which what is left
    of each becomes white and as large [-], shape (m, k). level : of that about each sample, over its rms [-], shape
    (m, n).
    """

    highest: float
    beyond: float
    left: tuple[float, ...]
    lines: np.ndarray = field(repr=False)
    whitening: np.ndarray = field(repr=False)
    level: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class Record:
    """One recording or a piece of it, all arrays of shape (n,), SI units; acceleration and pressure may be absent.

    pressure : of chamber A less that of chamber B [Pa]; the offset of the transducers is not known.
    begin : time of the first sample since the recording's start [s]. command_before : before the first sample [-],
        null where the recording begins with the motion. moved : False of a command alone, at a place.
    delay : of the accelerometer [s], which has been taken out but for that of a filter. cutoff : of that filter [Hz];
        0: none. valid : samples whose acceleration was measured, shape (n,): not clipped, nor too late to be recorded;
        None: all. calmest : noise of the acceleration at most, where a model has shown it [m/s²]. shift : null shift of
        the valve that models have added to the commands [-]. run : number of the recording, of those that are learned
        from and then those held out. own : what a force-driven axis takes from this recording
        for itself, see axis_model.py. explained : where the command explains the response; None: everywhere.
        past : velocity before the first sample, which friction's film and a specimen remember, shape (k,) [m/s]; empty
        where it is not known.
    position_measured : False where the position is the acceleration integrated (signals/velocity_filter.py): runs
        begin there and volumes follow it, but it is never compared.
    """

    name: str
    sample_time: float
    commands: np.ndarray
    position: np.ndarray
    acceleration: np.ndarray | None = None
    pressure: np.ndarray | None = None
    begin: float = 0.0
    command_before: float = 0.0
    moved: bool = True
    delay: float = 0.0
    cutoff: float = 0.0
    valid: np.ndarray | None = None
    calmest: float = math.inf
    shift: float = 0.0
    run: int = 0
    own: tuple[str, ...] = ()
    explained: ExplainedBand | None = None
    past: np.ndarray = field(default_factory=lambda: NOTHING)
    position_measured: bool = True
    velocity: np.ndarray = field(init=False)
    track: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "velocity", derivative(self.position, self.sample_time))
        object.__setattr__(self, "track", low_pass(self.position, self.sample_time))

    @property
    def felt(self) -> np.ndarray:
        """Acceleration that was measured, or the derivative of the velocity without, shape (n,) [m/s²]."""
        return np.gradient(self.velocity, self.sample_time) if self.acceleration is None else self.acceleration

    @property
    def whole(self) -> np.ndarray:
        """Whether each sample has its acceleration, shape (n,); of no meaning in a recording without one."""
        return np.ones(len(self.commands), dtype=np.bool_) if self.valid is None else self.valid

    def part(self, span: slice) -> Record:
        """The samples from span.start to before span.stop, as a recording of the same name with nothing of its own."""
        first = span.start
        before = self.velocity[:first]
        return replace(
            self,
            past=np.concatenate([self.past, before]) if len(self.past) else before,
            commands=self.commands[span],
            position=self.position[span],
            acceleration=None if self.acceleration is None else self.acceleration[span],
            pressure=None if self.pressure is None else self.pressure[span],
            begin=self.begin + first * self.sample_time,
            command_before=float(self.commands[first - 1]) if first else self.command_before,
            valid=None if self.valid is None else self.valid[span],
            explained=self.explained and replace(self.explained, level=self.explained.level[:, span]),
            own=(),
        )

    @cached_property
    def motion(self) -> np.ndarray:
        """Velocity [m/s] and acceleration [m/s²], NaN without, shape (n, 2)."""
        none = np.full(len(self.commands), np.nan)
        felt = none if self.acceleration is None else np.where(self.whole, self.acceleration, np.nan)
        return np.column_stack([self.velocity if self.position_measured else none, felt])

    @cached_property
    def beginning(self) -> np.ndarray:
        """The motion before `start`, towards which a free run is corrected: a table that is recorded in the midst of a
        motion, or that rings, has pressures that follow from nothing else, shape (k, 2). Empty where the recording
        begins at rest, whose state is known: the noise of the measured velocity would only break a resting contact.
        """
        return self.motion[: self.start] if self.moved and not self._begins_at_rest() else UNSEEN

    @cached_property
    def slid(self) -> np.ndarray:
        """Velocity before the first sample as a film of friction has felt it, shape (k,) [m/s]: where a recording
        begins in a motion of which nothing is known, it has been like what follows.
        """
        return self.velocity[::-1] if self.begins_in_motion else self.past

    @cached_property
    def begins_in_motion(self) -> bool:
        """Whether it begins in a motion of which nothing is known."""
        setting_out = self._first_speed < SETTING_OUT * math.sqrt(np.mean(self.velocity**2))
        return not (len(self.past) or setting_out or self._begins_at_rest())

    @property
    def correction(self) -> float:
        """Rate at which its beginning corrects a run [1/s]; 0: a falling one, but for a table that is shaken."""
        return 0.0 if self.explained is None else FIRST_RATE

    def corrected_by(self, motion: np.ndarray) -> Record:
        """The same recording with another motion that corrects its runs, shape (n, 2); NaN where a run is free."""
        other = copy.copy(self)
        other.__dict__["motion"] = motion
        return other

    @property
    def _first_speed(self) -> float:
        return math.sqrt(np.mean(self.velocity[: max(3, round(AT_REST / self.sample_time))] ** 2))

    def _begins_at_rest(self) -> bool:
        return self._first_speed < QUIET * self.velocity_noise()

    def acceleration_left(self, simulated: np.ndarray) -> np.ndarray:
        """Acceleration measured less that of runs, shape (…, n), from `start` on; 0 where it was not measured."""
        return np.where(self.whole, self.acceleration - simulated, 0.0)[..., self.start :]

    @property
    def start(self) -> int:
        """First sample that is compared."""
        return min(round(SETTLE / self.sample_time), len(self.commands) // 4)

    def in_band(self, values: np.ndarray) -> np.ndarray:
        """What a signal has where the command explains the response, along its last axis."""
        return values if self.explained is None else low_pass(values, self.sample_time, self.explained.highest)

    def whitened(self, values: np.ndarray, channel: int) -> np.ndarray:
        """What rows of residuals of a channel (0 velocity, 1 acceleration, 2 load pressure) have in that band, where
        noise is even.
        """
        if self.explained is None:
            return values
        band = self.explained
        below = self.in_band(values)  # first: what rings beyond would break at the mirrored ends
        white = with_gains(below, self.sample_time, band.lines, band.whitening[channel])
        return np.asarray(white / band.level[channel, self.start :])

    @property
    def every(self) -> int:
        """Every how many samples one is compared: each where all of the response is, else as many as its band has."""
        return 1 if self.explained is None else max(int(OVER / (2.0 * self.explained.highest * self.sample_time)), 1)

    def position_noise(self) -> float:
        """Standard deviation of the position noise, not below that of its rounding to steps [m]."""
        return max(white_deviation(self.position), resolution(self.position) / math.sqrt(12.0))

    @cached_property
    def noise_from_periods(self) -> dict[str, float]:
        """Standard deviation of what changes from period to period of a command that repeats; empty where none does."""
        span = slice(self.start, None)
        found = dict[str, float | None]()
        if self.position_measured:
            found["velocity"] = periodic_deviation(self.velocity[span], self.commands[span])
        if self.acceleration is not None:
            found["acceleration"] = periodic_deviation(self.acceleration[span], self.commands[span])
        return {channel: value for channel, value in found.items() if value is not None}

    def velocity_noise(self) -> float:
        """Standard deviation of the noise that passes the velocity filter [m/s], not below that of its rounding."""
        if self.explained is not None:
            return self.explained.left[0]
        gain = velocity_noise_gain(self.sample_time)
        if "velocity" in self.noise_from_periods:
            rounding = gain * resolution(self.position) / math.sqrt(12.0)
            return max(self.noise_from_periods["velocity"], rounding)
        return gain * self.position_noise()

    def acceleration_noise(self) -> float:
        """Standard deviation of the acceleration noise [m/s²]."""
        assert self.acceleration is not None
        if self.explained is not None:
            return self.explained.left[1]
        return min(self.noise_from_periods.get("acceleration", self._white_acceleration), self.calmest)

    def deviations(self) -> tuple[float, float]:
        """Deviation of the velocity [m/s] and the acceleration [m/s²] that counts as noise; 0 of what is not measured.

        Not below a part of each one's size: no model is better than that.
        """
        span = slice(self.start, None)
        velocity = 0.0
        if self.position_measured:
            velocity = math.hypot(self.velocity_noise(), MODEL_FLOOR * float(np.std(self.velocity[span])))
        if self.acceleration is None:
            return velocity, 0.0
        floor = MODEL_FLOOR * float(np.std(self.acceleration[span]))
        return velocity, math.hypot(self.acceleration_noise(), floor)

    def pressure_noise(self) -> float:
        """Standard deviation of the noise of the load pressure [Pa], not below that of its rounding."""
        assert self.pressure is not None
        if self.explained is not None:
            return self.explained.left[2]
        return max(white_deviation(self.pressure), resolution(self.pressure) / math.sqrt(12.0))

    def pressure_deviation(self) -> float:
        """Deviation of the load pressure that counts as noise, not below what transducers of their class err [Pa]."""
        assert self.pressure is not None
        return math.hypot(self.pressure_noise(), TRANSDUCER_CLASS * float(np.std(self.pressure[self.start :])))

    @cached_property
    def _white_acceleration(self) -> float:
        assert self.acceleration is not None
        return white_deviation(self.acceleration)


def relative_error(measured: np.ndarray, simulated: np.ndarray) -> float:
    """rms(measured − simulated) / rms(measured − mean)."""
    return float(np.sqrt(np.mean((measured - simulated) ** 2)) / np.std(measured))


def windows(records: list[Record], seconds: float, window: float = 2.5) -> list[Record]:
    """Pieces of the recordings, evenly spread, of about `seconds` in all: a cheaper problem for a first look.

    Recordings that are no longer in total are returned as they are. A piece keeps its recording's name. Where the
    command does not explain all of the response, more is needed: the loudest pieces, LONGER times as long and as many.
    """
    shaken = records[0].explained is not None
    if shaken:
        seconds, window = LONGER * seconds, LONGER * window
    total = sum(len(r.commands) * r.sample_time for r in records)
    if total <= 1.2 * seconds:
        return records
    if shaken:
        return _loudest(records, seconds, window)
    pieces = []
    for r in records:
        length = min(round(window / r.sample_time), len(r.commands))
        count = max(round(seconds * len(r.commands) * r.sample_time / total / window), 1)
        for first in np.linspace(0, len(r.commands) - length, count).astype(int):
            pieces.append(r.part(slice(first, first + length)))
    return pieces


def _loudest(records: Sequence[Record], seconds: float, window: float) -> list[Record]:
    """The pieces of the recordings that move most, of about `seconds` in all and each of `window` [s]."""
    pieces = []
    for r in records:
        length = min(round(window / r.sample_time), len(r.commands))
        moved = energies(r.velocity, length)
        for _ in range(max(round(seconds / window / len(records)), 1)):
            first = int(np.argmax(moved))
            if moved[first] < 0.0:
                break
            pieces.append(r.part(slice(first, first + length)))
            moved[max(first - length + 1, 0) : first + length] = -1.0
    return pieces


def longest(records: Sequence[Record]) -> list[Record]:
    """The longest part of every recording."""
    names = dict.fromkeys(r.name for r in records)
    return [max((r for r in records if r.name == name), key=lambda r: len(r.commands)) for name in names]


class Compared(NamedTuple):
    """What is compared of free runs, each of shape (m, n).

    Attributes
    ----------
    velocity : unfiltered [m/s]. acceleration : [m/s²]. position : of models that compare it [m].
    pressure : in chamber A less that in B, where the recording has it [Pa].
    """

    velocity: np.ndarray
    acceleration: np.ndarray
    position: np.ndarray | None = None
    pressure: np.ndarray | None = None


class DeclaredModel(ABC):
    """A declared model: the layout of its tables, and its free runs over recordings. MODELS has all of them by name.

    Attributes
    ----------
    layout : of its tables; its name is the model's. driven_by : signal of a recording that a Record's `commands` are.
    candidates_file : file of config/discovery with the effects it may lack. nuisances : whether the offset of each
    channel and recording is estimated with every fit. injects : whether a run can be corrected towards the measurement.
    smooth : whether its runs change with the parameters without small jumps, as friction makes them that holds a table
    fast for whole steps. positions, pressures : whether the position of its free run is compared as well, and the load
    pressure where it was measured.
    """

    layout: ClassVar[TableLayout]
    driven_by: ClassVar[str] = "valve_command"
    candidates_file: ClassVar[str]
    nuisances: ClassVar[bool] = False
    injects: ClassVar[bool] = False
    smooth: ClassVar[bool] = False
    positions: ClassVar[bool] = False
    pressures: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """Its name in MODELS, in config/identification and in the effects' `models`."""
        return self.layout.name

    @property
    def priors(self) -> tuple[tuple[int, float, float], ...]:
        """Column of the parameter vector, value and standard deviation of each number known before the fit."""
        return ()

    def may_move(self, name: str) -> bool:  # noqa: ARG002 (for a model whose table leaves only some numbers open)
        """Whether a fit may move a declared number."""
        return True

    def may_lack(self, effect: str) -> bool:  # noqa: ARG002 (the same)
        """Whether an effect may be missing."""
        return True

    @abstractmethod
    def compared(self, vectors: np.ndarray, record: Record, injection: float = 0.0, /) -> Compared:
        """What is compared of free runs for rows of parameters.

        injection : rate at which a model that `injects` is corrected towards what was measured [1/s].
        """

    def simulate(self, vectors: np.ndarray, record: Record, injection: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Unfiltered velocity [m/s] and acceleration [m/s²] for rows of parameters, each of shape (m, n)."""
        found = self.compared(vectors, record, injection)
        return found.velocity, found.acceleration

    def contradicted(
        self,
        before: TableParameters,  # noqa: ARG002 (for a model whose force is measured)
        after: TableParameters,  # noqa: ARG002 (the same)
        records: list[Record],  # noqa: ARG002 (the same)
    ) -> bool:
        """Whether something measured besides the motion speaks against what was added to a table."""
        return False

    @abstractmethod
    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run, shape (n, ≥ 3): position, velocity, acceleration, then columns of the model's own."""

    def run_under(self, table: TableParameters, record: Record, forces: np.ndarray) -> np.ndarray | None:  # noqa: ARG002
        """The run under an additional force [N], held from each sample, shape (n,); None for a model without one."""
        return None

    @abstractmethod
    def moved_mass(self, table: TableParameters) -> float:
        """Mass that makes a force of a residual acceleration [kg]; 1 where the model counts in forces per mass."""

    def first_table(self, records: list[Record]) -> TableParameters:  # noqa: ARG002 (for the models that can)
        """A first guess from the recordings alone; ShakeError where the model cannot do without a declared table."""
        raise ShakeError(f"the model {self.name} starts from a declared table, not from recordings")

    def quantities(self, record: Record, simulated: np.ndarray) -> dict[str, np.ndarray]:
        """What a residual may depend on, each of shape (n,); `simulated` as `run` gives it."""
        return {
            "position": record.track,
            "velocity": record.velocity,
            "direction": np.sign(record.velocity),
            **self.inner_quantities(simulated),
            "time": record.begin + np.arange(len(simulated)) * record.sample_time,
        }

    def inner_quantities(self, simulated: np.ndarray) -> dict[str, np.ndarray]:  # noqa: ARG002 (for models with some)
        """Those among them that are simulated, not measured."""
        return {}


@final
class FullModel(DeclaredModel):
    """The sixth-order table of (6.15)."""

    layout = FULL_LAYOUT
    candidates_file = "effects"
    injects = True
    smooth = True
    pressures = True

    def compared(self, vectors: np.ndarray, record: Record, injection: float = 0.0) -> Compared:
        """Velocity, acceleration and, where it was measured, the load pressure."""
        out = self._ran(vectors, self.begun(vectors, record), record, injection)
        pressure = None if record.pressure is None else out[:, :, 2] - out[:, :, 3]
        return Compared(out[:, :, 0], out[:, :, 1], None, pressure)

    @staticmethod
    def _ran(vectors: np.ndarray, states: np.ndarray, record: Record, injection: float = 0.0) -> np.ndarray:
        """Motion, and the pressures where they were measured, of rows of parameters from these states."""
        return run_batch(
            *(vectors, states, record.commands, record.sample_time),
            track=record.track,
            command_before=record.command_before,
            measured=record.motion if injection > 0.0 else record.beginning,
            injection=injection or record.correction,
            cutoff=record.cutoff,
            columns=MOTION if record.pressure is None else MOTION + CHAMBERS,
            tolerance=SMOOTH,
        )

    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run with the columns of plant.simulation.COLUMNS."""
        return self.run_under(table, record, NOTHING)

    def run_under(self, table: TableParameters, record: Record, forces: np.ndarray) -> np.ndarray:
        """The run under an additional force."""
        (state,) = self.begun(table.vector()[None, :], record)
        return run(
            *(table, record.commands, record.sample_time),
            position=record.track,
            forces=forces,
            state=state,
            command_before=record.command_before,
            measured=record.beginning,
            injection=record.correction,
            cutoff=record.cutoff,
            tolerance=SMOOTH,
        )

    def begun(self, vectors: np.ndarray, record: Record) -> np.ndarray:
        """States of rows of parameters at the first sample of a recording, shape (m, STATES)."""
        states = np.array([initial_state(v, record.track[0]) for v in vectors])
        states[:, VELOCITY], states[:, CLOCK] = record.velocity[0], record.begin
        for vector, state in zip(vectors, states, strict=True):
            remember(vector, state, record.past, record.slid, record.sample_time)
        sway = np.flatnonzero(vectors[:, SPECIMEN_MASS] > 0.0)
        if len(sway) and record.begins_in_motion and record.acceleration is not None and record.explained is None:
            states[sway] = self._swaying(vectors[sway], states[sway], record)
        return states

    def _swaying(self, vectors: np.ndarray, states: np.ndarray, record: Record) -> np.ndarray:
        """States with the specimen's sway that explains most of the beginning of what is compared (Gauss-Newton)."""
        first, found = record.part(slice(0, 4 * record.start)), states.copy()  # which has the same start
        own, omega = [SPECIMEN, SPECIMEN_RATE], 2.0 * math.pi * vectors[:, SPECIMEN_FREQUENCY]
        most = SWAY_MOST * float(np.std(first.felt)) * np.column_stack([omega**-2.0, 1.0 / omega])
        if len(states) > 1:
            found[:, own] = self._swaying(vectors[:1], states[:1], record)[:, own]
        for _ in range(SWAY_STEPS):
            tried = np.repeat(found, 3, axis=0)
            tried[1::3, SPECIMEN] += SWAY
            tried[2::3, SPECIMEN_RATE] += SWAY * omega
            made = self._ran(np.repeat(vectors, 3, axis=0), tried, first)[:, :, 1]
            left = np.nan_to_num(first.acceleration_left(made), posinf=0.0, neginf=0.0)
            rest, *swayed = left.reshape(len(found), 3, -1).swapaxes(0, 1)
            slopes = rest[:, None] - np.stack(swayed, axis=1)
            parts = np.array([np.linalg.lstsq(j.T, r, rcond=1e-6)[0] for j, r in zip(slopes, rest, strict=True)])
            found += np.einsum("ij,ijk->ik", parts, tried.reshape(len(found), 3, -1)[:, 1:] - found[:, None])
            found[:, own] = np.clip(found[:, own], -most, most)
            if np.max(np.abs(parts)) < SWAY_FOUND:
                break
        return found

    def moved_mass(self, table: TableParameters) -> float:
        """Declared mass in motion [kg]."""
        return table.moved_mass

    def inner_quantities(self, simulated: np.ndarray) -> dict[str, np.ndarray]:
        """Load pressure [Pa], spool [-], and the spool times the root of its pressure drop."""
        load, opening = simulated[:, 3] - simulated[:, 4], simulated[:, 6]
        drop = np.maximum(simulated[:, 5] - np.sign(opening) * load, 0.0)
        return {"load_pressure": load, "valve_opening": opening, "flow": opening * np.sqrt(drop)}


FULL = FullModel()
