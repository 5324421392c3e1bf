"""A reference as it is played: all samples computed once, then looked up by index.

Positions, velocities and accelerations come from one function of time and its derivatives (closed form,
exact integral or exact solution of the filter), never from numerical differences.

Every reference shares its shaping: soft start and stop, the filter (5.1), the time of a live change. The filter
ẍ + 2ξ_f ω_f ẋ + ω_f² x = ω_f² r makes (x, ẋ, ẍ)_ref of a wish r. It is discretised exactly for an input that is linear
between samples: the state is advanced by the matrix exponential, so the result is the solution of the differential
equation at the sampling instants, whatever the sample time, and stable for every damping.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm

from shake_ros.compiled import njit
from shake_ros.control.reference import REFERENCES
from shake_ros.control.reference.motion import (
    Array,
    EarthquakeRecord,
    ReferenceParameters,
    columns,
    crest_factor,
    peaks,
    product,
    smooth_step,
)
from shake_ros.control.reference.recorded import RecordedParameters
from shake_ros.quantities import Parameters, ShakeError, quantity, unknown_name


def discretise(frequency: float, damping: float, sample_time: float) -> tuple[Array, Array, Array]:
    """Transition of the state s = (x, ẋ): s' = transition s + before r_k + after r_{k+1}.

    Parameters
    ----------
    frequency : ω_f [rad/s].
    damping : ξ_f [-].
    sample_time : [s].

    Returns
    -------
    transition (2, 2), before (2,), after (2,)
    """
    w, h = frequency, sample_time
    generator = np.zeros((4, 4))  # state x, ẋ, input r, increment of r over one sample
    generator[0, 1] = 1.0
    generator[1] = (-(w**2), -2.0 * damping * w, w**2, 0.0)  # (5.1)
    generator[2, 3] = 1.0 / h
    step = np.asarray(expm(generator * h), dtype=np.float64)
    after = step[:2, 3]
    return step[:2, :2].copy(), step[:2, 2] - after, after.copy()


@njit
def _run(wish, frequency, damping, transition, before, after):  # type: ignore[no-untyped-def]
    states = np.zeros((wish.size, 3))
    x, v = wish[0], 0.0
    for k in range(wish.size):
        if k > 0:
            r, s = wish[k - 1], wish[k]
            x, v = (
                transition[0, 0] * x + transition[0, 1] * v + before[0] * r + after[0] * s,
                transition[1, 0] * x + transition[1, 1] * v + before[1] * r + after[1] * s,
            )
        states[k, 0] = x
        states[k, 1] = v
        states[k, 2] = frequency**2 * (wish[k] - x) - 2.0 * damping * frequency * v  # (5.1)
    return states


def apply(wish: Array, frequency: float, damping: float, sample_time: float) -> Array:
    """(x, ẋ, ẍ)_ref of shape (n, 3) for the wish r of shape (n,) [m], from rest at its first value."""
    parts = discretise(frequency, damping, sample_time)
    return np.asarray(_run(np.ascontiguousarray(wish, dtype=np.float64), frequency, damping, *parts))


def settling_time(frequency: float, damping: float) -> float:
    """Time [s] after which the filter's transient has decayed to e⁻²⁰ of its start."""
    slowest = damping - np.sqrt(damping**2 - 1.0) if damping > 1.0 else damping
    return float(20.0 / (frequency * slowest))


@dataclass(frozen=True)
class Shaping(Parameters):
    soft_start: float = quantity("s", "time of the C² ramp at the start; 0 = none", low=0.0, high=60.0)
    soft_stop: float = quantity("s", "time of the C² ramp at the end; 0 = none", low=0.0, high=60.0)
    change_time: float = quantity("s", "time over which a live change is faded in", low=0.1, high=60.0)
    filter_frequency: float = quantity("rad/s", "ω_f of the reference filter (5.1); 0 = no filter", low=0.0, high=1e4)
    filter_damping: float = quantity("-", "ξ_f of the reference filter (5.1)", low=0.1, high=10.0)


def window(time: Array, soft_start: float, soft_stop: float) -> tuple[Array, Array, Array]:
    """A window from 0 up to 1 and back to 0 with its first two derivatives by time; each of shape (n,).

    Raises ShakeError where start and stop overlap.
    """
    end = float(time[-1])
    if soft_start + soft_stop > end * (1.0 + 1e-9):
        raise ShakeError(
            f"reference: soft_start {soft_start:g} s + soft_stop {soft_stop:g} s exceed its length {end:g} s"
        )
    one = (np.ones_like(time), np.zeros_like(time), np.zeros_like(time))
    up, down = one, one
    if soft_start > 0.0:
        value, slope, curvature = smooth_step(time / soft_start)
        up = (value, slope / soft_start, curvature / soft_start**2)
    if soft_stop > 0.0:
        value, slope, curvature = smooth_step((end - time) / soft_stop)
        down = (value, -slope / soft_stop, curvature / soft_stop**2)
    return columns(product(up, down))


def shape(states: Array, shaping: Shaping, sample_time: float) -> Array:
    """Rows of shape (n, 3) with soft start and stop, then filtered; longer by the filter's settling time."""
    time: Array = np.arange(len(states), dtype=np.float64) * sample_time
    if shaping.soft_start > 0.0 or shaping.soft_stop > 0.0:
        states = product(columns(states), window(time, shaping.soft_start, shaping.soft_stop))
    if shaping.filter_frequency > 0.0:
        settle = settling_time(shaping.filter_frequency, shaping.filter_damping)
        wish = np.append(states[:, 0], np.full(int(np.ceil(settle / sample_time)), states[-1, 0]))
        states = apply(wish, shaping.filter_frequency, shaping.filter_damping, sample_time)
        states[-1, 1:] = 0.0
    return states


AT_REST = 1e-6
"""Largest velocity at start and end, as a fraction of the peak, that still counts as rest."""


class Program:
    """Samples of a reference, soft start and stop included. Immutable.

    Parameters
    ----------
    kind : a name of REFERENCES.
    parameters : an object of REFERENCES[kind].
    shaping : soft start and stop, filter (5.1).
    sample_time : [s].
    record : (time [s], acceleration [m/s²]) of an accelerogram, used by `earthquake`; None = synthetic.

    Raises
    ------
    UnknownName, or ShakeError where the reference would start or end with a jump in velocity.
    """

    def __init__(
        self,
        kind: str,
        parameters: ReferenceParameters,
        shaping: Shaping,
        sample_time: float,
        record: tuple[Array, Array] | None = None,
    ) -> None:
        if kind not in REFERENCES:
            raise unknown_name("reference", kind, REFERENCES)
        if not isinstance(parameters, REFERENCES[kind]):
            raise ShakeError(f"reference '{kind}' takes {REFERENCES[kind].__name__}, got {type(parameters).__name__}")
        if not 1e-6 <= sample_time <= 1.0:
            raise ShakeError(f"reference: sample_time = {sample_time:g} s is outside 1e-06 … 1 s")
        recorded = (
            None if record is None else EarthquakeRecord(*(np.asarray(part, dtype=np.float64) for part in record))
        )
        if isinstance(parameters, RecordedParameters):
            states, notes = parameters.motion(sample_time, recorded)
        else:
            states, notes = parameters.motion(sample_time)
        states = shape(states, shaping, sample_time)
        _check_rest(kind, states, sample_time)
        self._set(kind, states, sample_time, notes)

    def _set(self, kind: str, states: Array, sample_time: float, notes: dict[str, Any]) -> None:
        self.kind = kind
        self.sample_time = sample_time
        self.notes = dict(notes)
        self._states = np.ascontiguousarray(states)
        self._states.flags.writeable = False
        self._last = (float(states[-1, 0]), 0.0, 0.0)

    @classmethod
    def from_states(cls, kind: str, states: Array, sample_time: float, notes: dict[str, Any]) -> Program:
        """A program of given samples (n, 3); the caller answers for their consistency."""
        program = cls.__new__(cls)
        program._set(kind, states, sample_time, notes)
        return program

    @property
    def length(self) -> int:
        """Number of samples, soft start and stop and the filter's settling included."""
        return len(self._states)

    @property
    def states(self) -> Array:
        """All samples, (length, 3): position [m], velocity [m/s], acceleration [m/s²]; read-only."""
        return self._states

    def at(self, k: int) -> tuple[float, float, float]:
        """Position [m], velocity [m/s], acceleration [m/s²] at sample k; rest before the start and after the end."""
        if 0 <= k < len(self._states) - 1:
            position, velocity, acceleration = self._states[k].tolist()
            return position, velocity, acceleration
        return self._last if k > 0 else (float(self._states[0, 0]), 0.0, 0.0)

    def summary(self) -> dict[str, Any]:
        """Peaks and crest factors with the notes of the reference, by name."""
        position, velocity, acceleration = peaks(self._states)
        return {
            "kind": self.kind,
            "duration": (self.length - 1) * self.sample_time,
            "peak_position": position,
            "peak_velocity": velocity,
            "peak_acceleration": acceleration,
            "crest_factor_velocity": crest_factor(self._states[:, 1]),
            "crest_factor_acceleration": crest_factor(self._states[:, 2]),
            **self.notes,
        }

    def samples(self, first: int, count: int) -> Array:
        """Samples first … first + count − 1 as `at` gives them, (count, 3)."""
        index = np.arange(first, first + count)
        rows = self._states[np.clip(index, 0, self.length - 1)].copy()
        rows[(index < 0) | (index >= self.length - 1), 1:] = 0.0
        return rows


def _check_rest(kind: str, states: Array, sample_time: float) -> None:
    """Refuse a reference that starts or ends moving, or that jumps in between."""
    fastest = float(np.max(np.abs(states[:, 1])))
    for place, row, remedy in (("starts", states[0], "soft_start"), ("ends", states[-1], "soft_stop")):
        if abs(row[1]) > AT_REST * fastest:
            raise ShakeError(
                f"reference '{kind}' {place} with {row[1]:.3g} m/s: give {remedy} > 0 or a filter_frequency > 0"
            )
    jump = float(np.max(np.abs(np.diff(states[:, 0]))))
    if jump > 1.5 * sample_time * fastest + 1e-12:
        raise ShakeError(f"reference '{kind}' jumps by {jump:.3g} m: give rise_time > 0 or a filter_frequency > 0")


LEVELS = frozenset({"amplitude", "scale", "peak_position", "peak_velocity", "peak_acceleration"})
"""Parameters that change the size of a reference and nothing of its course in time."""


def keeps_phase(old: Parameters, new: Parameters) -> bool:
    """Whether a change from `old` to `new` may go on at the same index; otherwise `crossfade` needs `restart`.

    >>> from shake_ros.control.reference.waves import SineParameters
    >>> slow = SineParameters(amplitude=0.02, frequency=1.0, duration=10.0)
    >>> keeps_phase(slow, slow.replace(amplitude=0.03)), keeps_phase(slow, slow.replace(frequency=2.0))
    (True, False)
    """
    names = {field.name for field in dataclasses.fields(old)} - LEVELS
    return type(old) is type(new) and all(getattr(old, name) == getattr(new, name) for name in names)


def crossfade(old: Program, new: Program, start: int, change_time: float, restart: bool = False) -> Program:
    """`old` until sample `start`, then faded into `new` over `change_time` along a C² ramp.

    Velocity and acceleration carry the derivatives of the ramp, so the three stay consistent. With `restart`
    the new program begins at its own sample 0 at `start` (for a change of frequency or of kind, and for a
    program that has ended); otherwise both run on the same index (a change of amplitude keeps its phase).

    Parameters
    ----------
    old, new : programs of one sample time.
    start : first sample of the change.
    change_time : [s], at least one sample.
    """
    if old.sample_time != new.sample_time:
        raise ShakeError(f"reference: sample times {old.sample_time:g} and {new.sample_time:g} s differ")
    start = max(start, 0)
    steps = max(1, round(change_time / old.sample_time))
    offset = start if restart else 0
    total = max(start + steps + 1, offset + new.length)
    span = steps * old.sample_time
    value, slope, curvature = smooth_step(np.arange(total - start) / steps)
    ramp = (value, slope / span, curvature / span**2)
    rows = old.samples(start, total - start)
    faded = rows + product(ramp, columns(new.samples(start - offset, total - start) - rows))
    return Program.from_states(new.kind, np.vstack((old.samples(0, start), faded)), old.sample_time, new.notes)
