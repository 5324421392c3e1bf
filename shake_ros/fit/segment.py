"""Recordings as a fit takes them: segments without a gap, what was measured and what the sensors' noise is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_filter

from shake_ros.fit.records import Record

Array = np.ndarray
FINDING, SETTLE = 0.3, 0.5  # start of a segment in which its state is found, and which counts in no likelihood [s]
LINEARITY = 1e-3  # of a position transducer, in parts of the motion: no model predicts it more closely than that
LEAST_STEPS = 20  # samples that settle at least


@dataclass(frozen=True)
class Segment:
    """A gapless piece of one recording, all arrays of shape (n,), SI units.

    Attributes
    ----------
    name : of the recording. run : its number. dt : [s]. commands : [-]. command_before : before the first one [-].
    position : [m]. acceleration : [m/s²], NaN where it was not measured. velocity : at the first sample [m/s].
    position_measured : False where the position is the acceleration integrated.
    pressure : of chamber A less that of B [Pa]; None where it was not measured.
    begin : time of the first sample since the recording's start [s]. past : velocity before it, shape (k,) [m/s].
    slid : the same as a film of friction has it, shape (k,) [m/s].
    noise : standard deviation of the noise of position [m], acceleration [m/s²] and, if measured, pressure [Pa].
    """

    name: str
    run: int
    dt: float
    commands: Array
    command_before: float
    position: Array
    acceleration: Array
    velocity: float
    begin: float
    noise: tuple[float, ...]
    pressure: Array | None = None
    past: Array = field(default_factory=lambda: np.zeros(0))
    slid: Array = field(default_factory=lambda: np.zeros(0))
    position_measured: bool = True

    @classmethod
    def of(cls, record: Record) -> Segment:
        """The segment of a record."""
        none = np.full(len(record.commands), np.nan)
        felt = none if record.acceleration is None else np.where(record.whole, record.acceleration, np.nan)
        floor = LINEARITY * float(np.std(record.position))
        noise = (
            float(np.hypot(record.position_noise(), floor)),
            1.0 if record.acceleration is None else record.acceleration_noise(),
            *(() if record.pressure is None else (record.pressure_deviation(),)),
        )
        return cls(
            record.name,
            record.run,
            record.sample_time,
            np.ascontiguousarray(record.commands, dtype=float),
            record.command_before,
            np.ascontiguousarray(record.position, dtype=float),
            felt,
            float(record.velocity[0]),
            record.begin,
            noise,
            record.pressure,
            record.past,
            record.slid,
            record.position_measured,
        )

    def shifted(self, null: float) -> Segment:
        """The same with the null shift of its valve larger by so much [-]."""
        return replace(self, commands=self.commands + null, command_before=self.command_before + null)

    @cached_property
    def _spline(self) -> CubicSpline | None:
        good = np.isfinite(self.acceleration)
        if np.count_nonzero(good) < 4:
            return None
        return CubicSpline(np.flatnonzero(good) * self.dt, self.acceleration[good])

    def measured(self, delay: float = 0.0) -> Array:
        """Position, acceleration as it was `delay` later [s], NaN without, and pressure if measured, shape (n, m)."""
        felt = self.acceleration
        if delay and self._spline is not None:
            time = np.arange(len(felt)) * self.dt + delay
            inside = (time >= 0.0) & (time <= (len(felt) - 1) * self.dt)
            near = np.clip(np.rint(time / self.dt).astype(int), 0, len(felt) - 1)
            felt = np.where(inside & np.isfinite(felt[near]), self._spline(time), np.nan)
        seen = self.position if self.position_measured else np.full(len(felt), np.nan)
        return np.column_stack([seen, felt, *(() if self.pressure is None else (self.pressure,))])

    @cached_property
    def loudness(self) -> float:
        """Root mean square of the acceleration [m/s²], of the position's second derivative without an accelerometer."""
        if np.isfinite(self.acceleration).any():
            return max(float(np.nanstd(self.acceleration)), 1e-9)
        slow = savgol_filter(self.position, 2 * max(round(0.02 / self.dt), 2) + 1, 2, deriv=2, delta=self.dt)
        return max(float(np.std(slow)), 1e-9)

    @property
    def found_by(self) -> int:
        """First sample by which the state is found."""
        return min(max(round(FINDING / self.dt), LEAST_STEPS), self.start)

    @property
    def start(self) -> int:
        """First sample that counts."""
        return min(max(round(SETTLE / self.dt), LEAST_STEPS), len(self.commands) // 3)

    @property
    def seconds(self) -> float:
        """Length [s]."""
        return len(self.commands) * self.dt


def pieces(records: Sequence[Record], seconds: float, length: float) -> list[Record]:
    """Evenly spread pieces of recordings, of about `seconds` in all; the recordings where they are no longer."""
    total = sum(len(r.commands) * r.sample_time for r in records)
    if total <= 1.2 * seconds:
        return list(records)
    found = []
    for r in records:
        samples = min(round(length / r.sample_time), len(r.commands))
        count = max(round(seconds * len(r.commands) * r.sample_time / total / length), 1)
        for first in np.linspace(0, len(r.commands) - samples, count + 2)[1:-1].astype(int):
            found.append(r.part(slice(first, first + samples)))
    return found
