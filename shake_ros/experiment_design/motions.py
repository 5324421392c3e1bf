"""Motions that a table can be asked for: shapes from rest to rest, as large as limits allow, from config/experiment.

The second half of each mirrors the first, so that either half shows what the whole shows: one is fitted, the other is
validation data.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.signal import sawtooth

from shake_ros.control.reference.motion import Envelope, peaks, smooth_step
from shake_ros.quantities import ShakeError, strict_keys, unknown_name
from shake_ros.settings import load_content

Array = NDArray[np.float64]
FADE = 0.5  # at either end of a half [s]
CORNER = 0.02  # over which a triangle turns and a pulse rises [s]
LEAST_HALF = 2.0 * FADE + 0.5  # [s]
KEYS = ("kind", "low", "high")


@dataclass(frozen=True)
class Excitation:
    """A motion that could be played."""

    name: str  # of config/experiment/motions.yaml
    kind: str  # of SHAPES
    # low, high: frequencies [Hz]; `high` of those that have a band
    low: float
    high: float
    part: float  # of the largest motion within the limits [-]
    seconds: float  # length [s]

    def samples(self, limits: Envelope, sample_time: float) -> Array:
        """Position [m], velocity [m/s] and acceleration [m/s²], shape (n, 3)."""
        count = round(0.5 * self.seconds / sample_time)
        time = np.asarray(np.arange(count) * sample_time, dtype=np.float64)
        shape = SHAPES[self.kind](self, time)
        rise, fall = (smooth_step(t / FADE)[0] for t in (time, time[::-1]))
        half = (shape - np.mean(shape)) * rise * fall
        position = np.concatenate([half, -half])
        velocity = np.gradient(position, sample_time)
        rows = np.column_stack([position, velocity, np.gradient(velocity, sample_time)])
        largest = peaks(rows)
        size = min(limit / most for limit, most in zip(limits, largest, strict=True) if most > 0.0)
        return self.part * size * rows

    def neighbours(self) -> Iterator[Excitation]:
        """Motions a step away: another frequency, size or length."""
        for factor in (1.6, 1.0 / 1.6):
            yield replace(self, low=self.low * factor, high=self.high * factor)
        yield replace(self, part=0.6 * self.part)
        yield replace(self, part=min(1.0, self.part / 0.6))
        yield replace(self, seconds=max(0.6 * self.seconds, 2.0 * LEAST_HALF))

    def __str__(self) -> str:
        band = f"{self.low:.3g} to {self.high:.3g} Hz" if self.high else f"{self.low:.3g} Hz"
        return f"{self.name}, {band}, {self.seconds:.3g} s"


def _triangle(m: Excitation, time: Array) -> Array:
    """Constant speed to and fro, with rounded corners."""
    return _rounded(sawtooth(2.0 * np.pi * m.low * time, 0.5), time)


def _dwell(m: Excitation, time: Array) -> Array:
    """A smooth move, then rest: to one side, back, to the other side, back."""
    quarter = 4.0 * m.low * time
    number, within = np.floor(quarter), quarter % 1.0
    stations = np.array([0.0, 1.0, 0.0, -1.0])
    here, there = (stations[(number.astype(int) + k) % 4] for k in (0, 1))
    return np.asarray(here + (there - here) * smooth_step(2.0 * within)[0])


def _sweep(m: Excitation, time: Array) -> Array:
    """Logarithmic sweep of constant velocity."""
    rate = np.log(m.high / m.low) / time[-1]
    frequency = m.low * np.exp(rate * time)
    return np.asarray(np.sin(2.0 * np.pi * (frequency - m.low) / rate) / frequency)


def _lines(m: Excitation, time: Array) -> Array:
    """Frequencies of the band whose periods are parts of the time [Hz]."""
    return np.arange(max(m.low, 1.0 / time[-1]), m.high, 1.0 / time[-1])


def _multisine(m: Excitation, time: Array) -> Array:
    """Every line of the band with equal velocity, in Schroeder's phases, which keep the peaks low."""
    lines = _lines(m, time)
    number = np.arange(len(lines))
    phase = -np.pi * number * (number + 1) / len(lines)
    return np.asarray(np.cos(2.0 * np.pi * np.outer(time, lines) + phase) @ (1.0 / lines))


def _random(m: Excitation, time: Array) -> Array:
    """The same band in random phases, with equal acceleration above 2 Hz."""
    lines = _lines(m, time)
    phase = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, len(lines))
    return np.asarray(np.cos(2.0 * np.pi * np.outer(time, lines) + phase) @ (1.0 / (lines * np.maximum(lines, 2.0))))


def _pulses(m: Excitation, time: Array) -> Array:
    """Pulses of velocity to either side, of several lengths."""
    period = (m.low * time) % 1.0
    width = 0.1 + 0.35 * (np.floor(m.low * time) % 3) / 2.0
    speed = np.where(period < width, 1.0, np.where((period >= 0.5) & (period < 0.5 + width), -1.0, 0.0))
    return np.asarray(cumulative_trapezoid(_rounded(speed, time), time, initial=0.0))


def _rounded(values: Array, time: Array) -> Array:
    """Values with their corners rounded over CORNER, twice."""
    count = max(round(CORNER / (time[1] - time[0])), 1)
    for _ in range(2):
        padded = np.concatenate([np.full(count // 2, values[0]), values, np.full(count - 1 - count // 2, values[-1])])
        values = np.convolve(padded, np.full(count, 1.0 / count), "valid")
    return values


SHAPES = {
    "sine": lambda m, time: np.sin(2.0 * np.pi * m.low * time),
    "triangle": _triangle,
    "dwell": _dwell,
    "sweep": _sweep,
    "multisine": _multisine,
    "random": _random,
    "pulses": _pulses,
}
BANDS = ("sweep", "multisine", "random")


def library(name: str = "motions") -> list[Excitation]:
    """The motions of config/experiment/<name>.yaml or of a file, each in every part."""
    content, path = load_content("experiment", name, ("parts", "seconds", "motions"), ())
    try:
        parts, seconds = [float(p) for p in content["parts"]], float(content["seconds"])
        made = [
            Excitation(n, str(e["kind"]), float(e["low"]), float(e.get("high", 0.0)), part, seconds)
            for n, e in content["motions"].items()
            for part in parts
        ]
    except (AttributeError, KeyError, TypeError, ValueError):
        raise ShakeError(f"{path}: needs parts, seconds, and motions with kind, low and, for a band, high") from None
    for name, entry in content["motions"].items():
        strict_keys(entry, KEYS, f"{path}: {name}", kind="key")
    for motion in made:
        if motion.kind not in SHAPES:
            raise unknown_name("kind", motion.kind, SHAPES, f"{path}: {motion.name}")
        if not (motion.low > 0.0 and 0.0 < motion.part <= 1.0 and motion.seconds >= 2.0 * LEAST_HALF):
            wanted = f"low above 0, parts within 0 to 1, seconds from {2.0 * LEAST_HALF:g}"
            raise ShakeError(f"{path}: {motion.name}: expected {wanted}")
        if motion.kind in BANDS and not motion.high > motion.low:
            raise ShakeError(f"{path}: {motion.name}: high must be above low")
    return made
