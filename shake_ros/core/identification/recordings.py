"""Recordings as a fit sees them, and the free-running simulation error over several of them (chapter 4, 6.3.3.2).

Open-loop positions drift, so velocity and acceleration are fitted. Velocity is the zero-phase filtered derivative of
the measured position; the simulated velocity goes through the same filter (filtered against filtered). Volumes and
position-dependent effects follow the measured position. What the state was when the recording began shows in its first
half second: a run of the full model is drawn to the measured motion there, and free from then on.
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, final

import numpy as np

from shake_ros.core.identification.noise import periodic_deviation, resolution, white_deviation
from shake_ros.core.identification.velocity_filter import (
    CUTOFF,
    derivative,
    filtered_velocity,
    low_pass,
    velocity_noise_gain,
)
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableLayout, TableParameters
from shake_ros.core.plant.simulation import SMOOTH, UNSEEN, initial_state, run, run_batch, workers
from shake_ros.core.plant.states import CLOCK, VELOCITY
from shake_ros.core.quantities import ShakeError

SETTLE = 0.5  # start of a recording that is simulated but not compared [s]: pressures are not known there …
DRAWN = 40.0  # … and found by drawing the run towards the measured motion at this rate [1/s], unless …
AT_REST = 0.01  # … it begins at rest: with a velocity over this time [s] …
QUIET = 4.0  # … below so many times its noise
BLOCK = 0.5  # length of a block of time for standard errors [s], shorter where the recordings would give less than
BLOCKS = 24  # blocks in all: with fewer, the scatter of the blocks tells too little of itself
MODEL_FLOOR = 2e-3  # weights do not fall below this part of a channel's rms: no model is better than that


@dataclass(frozen=True)
class Record:
    """One recording or a piece of it, all arrays of shape (n,), SI units; acceleration may be absent.

    begin : time of the first sample since the recording's start [s]. standing : command before the first sample [-],
        null where the recording begins with the motion. moved : False of a command alone, at a place.
    delay : of the accelerometer [s], which has been taken out but for that of a filter. cutoff : of that filter [Hz];
        0: none. blind : samples at the end whose acceleration came too late to be recorded. calmest : noise of the
        acceleration at most, where a model has shown it [m/s²].
    """

    name: str
    sample_time: float
    commands: np.ndarray
    position: np.ndarray
    acceleration: np.ndarray | None = None
    begin: float = 0.0
    standing: float = 0.0
    moved: bool = True
    delay: float = 0.0
    cutoff: float = 0.0
    blind: int = 0
    calmest: float = math.inf
    velocity: np.ndarray = field(init=False)
    track: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "velocity", derivative(self.position, self.sample_time))
        object.__setattr__(self, "track", low_pass(self.position, self.sample_time))

    @cached_property
    def motion(self) -> np.ndarray:
        """Velocity [m/s] and acceleration [m/s²], NaN without, shape (n, 2)."""
        none = np.full(len(self.commands), np.nan)
        return np.column_stack([self.velocity, none if self.acceleration is None else self.acceleration])

    @cached_property
    def beginning(self) -> np.ndarray:
        """The motion before `start`, towards which a free run is drawn: a table that is recorded in the midst of a
        motion, or that rings, has pressures that follow from nothing else, shape (k, 2). Empty where the recording
        begins at rest, whose state is known: the noise of the measured velocity would only break a standing contact.
        """
        return self.motion[: self.start] if self.moved and not self._begins_at_rest() else UNSEEN

    def _begins_at_rest(self) -> bool:
        first = self.velocity[: max(3, round(AT_REST / self.sample_time))]
        return bool(math.sqrt(np.mean(first**2)) < QUIET * self.velocity_noise())

    @property
    def start(self) -> int:
        """First sample that is compared."""
        return min(round(SETTLE / self.sample_time), len(self.commands) // 4)

    def position_noise(self) -> float:
        """Standard deviation of the position noise, not below that of its rounding to steps [m]."""
        return max(white_deviation(self.position), resolution(self.position) / math.sqrt(12.0))

    @cached_property
    def noise_from_periods(self) -> dict[str, float]:
        """Standard deviation of what changes from period to period of a command that repeats; empty where none does."""
        span = slice(self.start, None)
        found = {"velocity": periodic_deviation(self.velocity[span], self.commands[span])}
        if self.acceleration is not None:
            found["acceleration"] = periodic_deviation(self.acceleration[span], self.commands[span])
        return {channel: value for channel, value in found.items() if value is not None}

    def velocity_noise(self) -> float:
        """Standard deviation of the noise that passes the velocity filter [m/s], not below that of its rounding."""
        gain = velocity_noise_gain(self.sample_time)
        if "velocity" in self.noise_from_periods:
            rounding = gain * resolution(self.position) / math.sqrt(12.0)
            return max(self.noise_from_periods["velocity"], rounding)
        return gain * self.position_noise()

    def acceleration_noise(self) -> float:
        """Standard deviation of the acceleration noise [m/s²]."""
        assert self.acceleration is not None
        return min(self.noise_from_periods.get("acceleration", self._white_acceleration), self.calmest)

    @cached_property
    def _white_acceleration(self) -> float:
        assert self.acceleration is not None
        return white_deviation(self.acceleration)


def relative_error(measured: np.ndarray, simulated: np.ndarray) -> float:
    """rms(measured − simulated) / rms(measured − mean)."""
    return float(np.sqrt(np.mean((measured - simulated) ** 2)) / np.std(measured))


def windows(records: list[Record], seconds: float, window: float = 2.5) -> list[Record]:
    """Pieces of the recordings, evenly spread, of about `seconds` in all: a cheaper problem for a first look.

    Recordings that are no longer in total are returned as they are. A piece keeps its recording's name.
    """
    total = sum(len(r.commands) * r.sample_time for r in records)
    if total <= 1.2 * seconds:
        return records
    pieces = []
    for r in records:
        length = min(round(window / r.sample_time), len(r.commands))
        count = max(round(seconds * len(r.commands) * r.sample_time / total / window), 1)
        for first in np.linspace(0, len(r.commands) - length, count).astype(int):
            span = slice(first, first + length)
            acceleration = None if r.acceleration is None else r.acceleration[span]
            begin = r.begin + first * r.sample_time
            standing = float(r.commands[first - 1]) if first else r.standing
            pieces.append(
                Record(
                    r.name,
                    r.sample_time,
                    r.commands[span],
                    r.position[span],
                    acceleration,
                    begin,
                    standing,
                    delay=r.delay,
                    cutoff=r.cutoff,
                    blind=max(0, r.blind - (len(r.commands) - first - length)),
                    calmest=r.calmest,
                )
            )
    return pieces


class DeclaredModel(ABC):
    """A declared model: the layout of its tables, and its free runs over recordings. MODELS has all of them by name.

    Attributes
    ----------
    layout : of its tables; its name is the model's. driven_by : signal of a recording that a Record's `commands` are.
    candidates_file : file of config/discovery with the effects it may lack. nuisances : whether the offset of each
    channel and recording is estimated with every fit. injects : whether a run can be drawn towards the measurement.
    smooth : whether its runs change with the parameters without small jumps, as friction makes them that holds a table
    fast for whole steps.
    """

    layout: ClassVar[TableLayout]
    driven_by: ClassVar[str] = "valve_command"
    candidates_file: ClassVar[str]
    nuisances: ClassVar[bool] = False
    injects: ClassVar[bool] = False
    smooth: ClassVar[bool] = False

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
    def simulate(self, vectors: np.ndarray, record: Record, injection: float = 0.0, /) -> tuple[np.ndarray, np.ndarray]:
        """Unfiltered velocity [m/s] and acceleration [m/s²] for rows of parameters, each of shape (m, n).

        injection : rate at which a model that `injects` is drawn towards what was measured [1/s].
        """

    @abstractmethod
    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run, shape (n, ≥ 3): position, velocity, acceleration, then columns of the model's own."""

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

    def simulate(self, vectors: np.ndarray, record: Record, injection: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and acceleration for rows of parameters."""
        measured = record.motion if injection > 0.0 else record.beginning
        starts = np.array([initial_state(v, record.track[0]) for v in vectors])
        starts[:, VELOCITY] = record.velocity[0]
        starts[:, CLOCK] = record.begin
        out = run_batch(
            *(vectors, starts, record.commands, record.sample_time),
            track=record.track,
            standing=record.standing,
            measured=measured,
            injection=injection or DRAWN,
            cutoff=record.cutoff,
            tolerance=SMOOTH,
        )
        return out[:, :, 0], out[:, :, 1]

    def run(self, table: TableParameters, record: Record) -> np.ndarray:
        """Free run with the columns of plant.simulation.COLUMNS."""
        state = initial_state(table.vector(), record.track[0])
        state[VELOCITY], state[CLOCK] = record.velocity[0], record.begin
        return run(
            *(table, record.commands, record.sample_time),
            position=record.track,
            state=state,
            standing=record.standing,
            measured=record.beginning,
            injection=DRAWN,
            cutoff=record.cutoff,
            tolerance=SMOOTH,
        )

    def moved_mass(self, table: TableParameters) -> float:
        """Declared mass in motion [kg]."""
        return table.moved_mass

    def inner_quantities(self, simulated: np.ndarray) -> dict[str, np.ndarray]:
        """Load pressure [Pa], spool [-], and the spool times the root of its pressure drop."""
        load, opening = simulated[:, 3] - simulated[:, 4], simulated[:, 6]
        drop = np.maximum(simulated[:, 5] - np.sign(opening) * load, 0.0)
        return {"load_pressure": load, "valve_opening": opening, "flow": opening * np.sqrt(drop)}


FULL = FullModel()


class RecordingProblem:
    """Weighted free-running simulation error over several recordings.

    Each channel is weighted by its noise, with a floor relative to its size; velocity counts with the number of its
    independent samples in the filter's band.
    """

    def __init__(self, records: list[Record], model: DeclaredModel = FULL) -> None:
        self.records = records
        self.model = model
        self.injection = 0.0
        self.velocity_weights = []
        self.acceleration_weights = []
        for r in records:
            floor = MODEL_FLOOR * float(np.std(r.velocity[r.start :]))
            independent = min(2.0 * CUTOFF * r.sample_time, 1.0)
            self.velocity_weights.append(np.sqrt(independent) / np.hypot(r.velocity_noise(), floor))
            if r.acceleration is not None:
                floor = MODEL_FLOOR * float(np.std(r.acceleration[r.start :]))
                self.acceleration_weights.append(1.0 / np.hypot(r.acceleration_noise(), floor))
            else:
                self.acceleration_weights.append(0.0)

    @property
    def smooth(self) -> bool:
        """Whether its residuals change with the parameters without small jumps."""
        return self.model.smooth

    def drawn(self, injection: float) -> RecordingProblem:
        """The same with runs that are drawn towards the measurement at a rate [1/s], where the model can."""
        if not self.model.injects:
            return self
        problem = copy.copy(self)
        problem.injection = injection
        return problem

    def simulate(self, vectors: np.ndarray, record: Record) -> tuple[np.ndarray, np.ndarray]:
        """Filtered velocity and acceleration of one recording, each of shape (m, n)."""
        velocity, acceleration = self.model.simulate(vectors, record, self.injection)
        velocity = filtered_velocity(velocity, record.sample_time)
        if self.model.nuisances:
            velocity = self._with_offset(velocity, record.velocity, record.start)
            if record.acceleration is not None:
                acceleration = self._with_offset(acceleration, record.acceleration, record.start)
        return velocity, acceleration

    @staticmethod
    def _with_offset(simulated: np.ndarray, measured: np.ndarray, start: int) -> np.ndarray:
        """Rows of simulated signals with the offset of least squares to the measured one."""
        return np.asarray(simulated + np.mean((measured - simulated)[:, start:], axis=1, keepdims=True))

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Weighted residuals of all recordings, shape (m, n)."""
        with ThreadPoolExecutor(workers()) as pool:
            runs = list(pool.map(lambda record: self.simulate(vectors, record), self.records))
        parts = []
        weights = zip(self.records, runs, self.velocity_weights, self.acceleration_weights, strict=True)
        for record, (velocity, acceleration), w_v, w_a in weights:
            parts.append(w_v * (velocity - record.velocity)[:, record.start :])
            if record.acceleration is not None:
                left = w_a * (acceleration - record.acceleration)[:, record.start :]
                left[:, left.shape[1] - record.blind :] = 0.0
                parts.append(left)
        parts += [(vectors[:, [i]] - value) / deviation for i, value, deviation in self.model.priors]
        return np.concatenate(parts, axis=1)

    @property
    def count(self) -> int:
        """Number of residuals."""
        return sum((len(r.commands) - r.start) * (1 if r.acceleration is None else 2) for r in self.records)

    def noise_cost(self) -> float:
        """Mean square of the weighted residuals that the sensor noise alone would leave [-]."""
        total = 0.0
        for record, w_v, w_a in zip(self.records, self.velocity_weights, self.acceleration_weights, strict=True):
            n = len(record.commands) - record.start
            total += n * (w_v * record.velocity_noise()) ** 2
            if record.acceleration is not None:
                total += n * (w_a * record.acceleration_noise()) ** 2
        return float(total / self.count)

    def blocks(self) -> np.ndarray:
        """Number of the block of time that each residual belongs to, shape (n,): velocity and acceleration share it."""
        parts, first = [], 0
        seconds = sum((len(r.commands) - r.start) * r.sample_time for r in self.records)
        block = min(BLOCK, seconds / BLOCKS)
        for record in self.records:
            n = len(record.commands) - record.start
            numbers = first + np.arange(n) // max(round(block / record.sample_time), 1)
            parts.append(numbers)
            if record.acceleration is not None:
                parts.append(numbers)
            first = int(numbers[-1]) + 1
        return np.concatenate([*parts, first + np.arange(len(self.model.priors))])

    def times(self) -> np.ndarray:
        """Time since its recording's start of each residual, shape (n,) [s]."""
        parts = []
        for record in self.records:
            time = record.begin + np.arange(record.start, len(record.commands)) * record.sample_time
            parts += [time] if record.acceleration is None else [time, time]
        return np.concatenate([*parts, np.zeros(len(self.model.priors))])

    def errors(self, vector: np.ndarray) -> dict[str, dict[str, float]]:
        """Relative error of velocity and acceleration per recording."""
        result: dict[str, dict[str, float]] = {}
        for name in dict.fromkeys(r.name for r in self.records):
            pieces = [(r, *self.simulate(vector[None, :], r)) for r in self.records if r.name == name]
            spans = [slice(r.start, None) for r, _, _ in pieces]
            entry = {
                "velocity": relative_error(
                    np.concatenate([r.velocity[s] for (r, _, _), s in zip(pieces, spans, strict=True)]),
                    np.concatenate([v[0, s] for (_, v, _), s in zip(pieces, spans, strict=True)]),
                )
            }
            measured = [
                r.acceleration[s] for (r, _, _), s in zip(pieces, spans, strict=True) if r.acceleration is not None
            ]
            if len(measured) == len(pieces):
                simulated = [a[0, s] for (_, _, a), s in zip(pieces, spans, strict=True)]
                entry["acceleration"] = relative_error(np.concatenate(measured), np.concatenate(simulated))
            result[name] = entry
        return result

    def noise(self) -> dict[str, float]:
        """Estimated noise of velocity [m/s] and acceleration [m/s²], root mean square over the recordings."""
        result = {"velocity": float(np.sqrt(np.mean([r.velocity_noise() ** 2 for r in self.records])))}
        measured = [r.acceleration_noise() ** 2 for r in self.records if r.acceleration is not None]
        if measured:
            result["acceleration"] = float(np.sqrt(np.mean(measured)))
        return result
