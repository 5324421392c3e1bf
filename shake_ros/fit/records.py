"""Recordings as a fit sees them (chapter 4, 6.3.3.2).

Velocity is the zero-phase filtered derivative of the measured position. The error over several recordings is that of
recording_problem.py.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from shake_ros.physics.plant.integration import FIRST_RATE
from shake_ros.physics.plant.simulation import NOTHING, UNSEEN
from shake_ros.signals.noise import periodic_deviation, resolution, white_deviation
from shake_ros.signals.stretches import energies
from shake_ros.signals.velocity_filter import derivative, low_pass, velocity_noise_gain, with_gains

SHORTEST = 1.0  # a part of a recording that is shorter than this tells nothing of the dynamics [s]
SETTLE = 0.5  # start of a recording that is simulated but not compared [s]: pressures are not known there …
AT_REST = 0.01  # … and found by correcting the run towards the motion, unless it rests at first: over this time [s] …
QUIET = 4.0  # … its velocity is below so many times its noise
SETTING_OUT = 0.1  # part of its root mean square below which a recording sets out from rest without noise
OVER = 0.8  # of the samples that a band needs where a filter ended at its highest frequency at once
LONGER = 3.0  # times the length and number of pieces where the command does not explain all of the response
MODEL_FLOOR = 2e-3  # part of a channel's rms that counts as noise at least
TRANSDUCER_CLASS = 0.01  # the same of a pressure: gain and linearity of common transducers


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
