"""An accelerogram in SI units, and what all its readers share: text, numbers, units, channels, plausibility."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shake_ros.quantities import ShakeError
from shake_ros.recordings.tables.units import parse_unit

Array = NDArray[np.float64]

UNITS = {"m/s2": 1.0, "cm/s2": 0.01, "g": 9.80665}
"""Size of each unit of acceleration that a caller may name, in m/s²."""

LARGEST_FILE = 200_000_000
MOST = 20_000_000
SHORTEST = 16
LARGEST_NUMBER = 1e37
"""Below every marker of an undefined value (1.7e38)."""
PLAUSIBLE = 1000.0
"""Largest acceleration [m/s²] that is taken for one (about 100 g)."""
EVEN = 0.01  # of a period, by which the times beside the samples may be off an even grid
DIFFERS = 0.01  # of the peak, by which the declared one may
OFFSET = 0.02  # of the peak about the mean, from which an offset is said

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?")


@dataclass(frozen=True)
class Accelerogram:
    """One channel of acceleration, uniform in time."""

    time_step: float  # [s]
    acceleration: Array  # (n,) [m/s²]
    name: str  # station, component or file name
    format: str  # name in the table of formats
    unit: str  # as found in the file, "m/s2", "cm/s2", "g", or how the file writes another one
    warnings: tuple[str, ...] = ()  # what a user should know, one line each

    @property
    def time(self) -> Array:
        """Times of the samples from zero [s], (n,)."""
        return np.asarray(np.arange(self.acceleration.size) * self.time_step, dtype=np.float64)

    @property
    def peak(self) -> float:
        """Largest magnitude [m/s²]."""
        return float(np.max(np.abs(self.acceleration)))


@dataclass(frozen=True)
class Text:
    """The lines of a file, and the errors that name it."""

    path: Path
    lines: Sequence[str]

    def bad(self, line: int, reason: str) -> ShakeError:
        """The error for index `line` (from 0)."""
        return ShakeError(f"{self.path}, line {line + 1}: {reason}")

    def line(self, index: int, what: str) -> str:
        """Line `index`, or an error that says what is missing at the end of the file."""
        if index >= len(self.lines):
            raise ShakeError(f"{self.path}, line {len(self.lines)}: the file ends before {what}")
        return self.lines[index]

    def number(self, word: str, line: int, what: str) -> float:
        """A finite number in decimal or Fortran notation (1.5E+0, .25, 1D-3)."""
        text = word.strip()
        if not NUMBER.fullmatch(text):
            raise self.bad(line, f"{what} '{shown(text)}' is not a finite number")
        value = float(text.replace("D", "E").replace("d", "e"))
        if abs(value) > LARGEST_NUMBER:
            raise self.bad(line, f"{what} '{shown(text)}' is not a plausible number")
        return value

    def whole(self, word: str, line: int, what: str, low: int = 1, high: int = MOST) -> int:
        """A whole number within low … high."""
        text = word.strip()
        if not re.fullmatch(r"[-+]?\d{1,12}", text):
            raise self.bad(line, f"{what} '{shown(text)}' is not a whole number")
        if not low <= int(text) <= high:
            raise self.bad(line, f"{what} = {int(text)} is outside {low} … {high}")
        return int(text)

    def fixed(self, first: int, count: int, width: int, per_line: int, what: str) -> tuple[list[float], int]:
        """`count` numbers in columns of `width` characters, `per_line` to a line; the index after the last one.

        Raises ShakeError where a line holds fewer or more than its share, or something that is not a number.
        """
        values: list[float] = []
        line = first
        while len(values) < count:
            row = self.line(line, f"number {len(values) + 1} of {count} {what}").rstrip()
            share, held = min(per_line, count - len(values)), -(-len(row) // width)
            if held != share:
                raise self.bad(line, f"{held} columns of {width} characters where {share} {what} should be")
            values += [self.number(row[i * width : (i + 1) * width], line, what) for i in range(share)]
            line += 1
        return values, line

    def free(self, first: int, what: str) -> list[float]:
        """All numbers from a line on, separated by blanks, commas or semicolons."""
        rows = enumerate(self.lines[first:], first)
        return [self.number(word, i, what) for i, row in rows for word in re.split(r"[\s,;]+", row.strip()) if word]


@dataclass(frozen=True, kw_only=True)
class Component:
    """One channel of a file: where its numbers stand and what they are."""

    label: str  # component, as the file calls it
    name: str  # of the station
    step: float  # between samples [s]
    unit: str  # of the numbers, empty where the file names none
    line: int  # index of the line that announces them, for messages
    first: int  # index of the first line of numbers
    count: int | None  # samples; None for all that follow
    # width, per_line: columns of characters and their number; 0 where blanks separate
    width: int = 0
    per_line: int = 0
    # columns, column: numbers to a sample, and which of them is the acceleration, from 0
    columns: int = 1
    column: int = 0
    factor: float = 1.0  # on the numbers, to `unit` [-]
    peak: float | None = None  # as the header declares it, in `unit`; None where it does not
    about_mean: bool = False  # the declared peak is about the mean
    followed: bool = False  # other numbers may stand right behind


def read_channel(text: Text, channels: Sequence[Component], channel: int, unit: str, form: str) -> Accelerogram:
    """The acceleration of one of a file's channels.

    Parameters
    ----------
    text : the file.
    channels : of it.
    channel : from 1; 0 where the file holds one.
    unit : that the caller names.
    form : name of the format.

    Raises
    ------
    ShakeError : one line with file and line.
    """
    number = chosen(text.path, [c.label for c in channels], channel)
    c = channels[number]
    if unit and c.unit and unit != c.unit:
        raise text.bad(c.line, f"the file is in {c.unit}, not in {unit}")
    found = unit or c.unit or "g"
    warnings = [] if unit or c.unit else ["the header names no unit, taken as g"]
    values = _values(text, c)
    acceleration, step = values[:, c.column] * c.factor, c.step
    if c.columns == 2:
        acceleration, step, more = _even(text, c, values[:, 0], acceleration)
        warnings += more
    acceleration = checked(text, step, acceleration, found, c.line)
    warnings += _peak_warning(c, acceleration, size_of(found))
    label = f", {c.label}" if len(channels) > 1 and c.label else ""
    name = f"{c.name or text.path.stem}{label}"
    return Accelerogram(step, acceleration, name, form, found, tuple(warnings))


def _values(text: Text, c: Component) -> Array:
    """The numbers of a channel, shape (n, columns)."""
    total = None if c.count is None else c.count * c.columns
    if c.width:
        assert total is not None
        read, after = text.fixed(c.first, total, c.width, c.per_line, "samples")
        following = text.lines[after].strip() if after < len(text.lines) else ""
        if not c.followed and NUMBER.match(following) and not re.search(r"[A-CF-Za-cf-z&|]", following):
            raise text.bad(after, f"more than the {c.count} samples that the header declares, or a damaged line")
    else:
        read = text.free(c.first, "acceleration")
        if total is None:
            total = len(read)
        if c.columns == 1 and len(read) == 2 * total:  # a time beside each sample
            read = read[1::2]
        if len(read) != total:
            raise text.bad(len(text.lines) - 1, f"{len(read) // c.columns} samples where the header declares {c.count}")
    return np.asarray(read, dtype=np.float64).reshape(-1, c.columns)


def _even(text: Text, c: Component, time: Array, acceleration: Array) -> tuple[Array, float, list[str]]:
    """Samples beside their times on an even grid, its step, and what was done."""
    if (np.diff(time) <= 0.0).any():
        raise text.bad(c.first, "the times beside the samples do not rise")
    step = float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else c.step
    grid = time[0] + step * np.arange(len(time))
    if np.max(np.abs(time - grid)) <= max(EVEN * step, 0.0011):
        return acceleration, step, []
    return np.interp(grid, time, acceleration), step, [f"its times are uneven: interpolated to steps of {step:.6g} s"]


def _peak_warning(c: Component, acceleration: Array, size: float) -> list[str]:
    """A warning where the peak that the header declares is not the one found, or where an offset is left in."""
    mean = float(np.mean(acceleration))
    about = float(np.max(np.abs(acceleration - mean)))
    found = about if c.about_mean else float(np.max(np.abs(acceleration)))
    lines = []
    if c.about_mean and abs(mean) > OFFSET * about:
        lines.append(f"an offset of {mean:.4g} m/s² is in the accelerogram; the peak about it is {about:.4g} m/s²")
    if c.peak is not None and abs(abs(c.peak) * size - found) > DIFFERS * found:
        lines.append(f"the header declares a peak of {abs(c.peak) * size:.4g} m/s², the samples reach {found:.4g} m/s²")
    return lines


def shown(text: str) -> str:
    """At most 40 printable characters of a text, for a message.

    >>> shown("a\\x07b")
    'a?b'
    """
    clean = "".join(c if c.isprintable() else "?" for c in text)
    return clean if len(clean) <= 40 else clean[:37] + "..."


def unit_in(text: str) -> str:
    """The unit of acceleration that a line names, empty where it names none.

    >>> unit_in("ACCELERATION TIME HISTORY IN UNITS OF G"), unit_in("acc [cm/s^2]"), unit_in("acceleration")
    ('g', 'cm/s2', '')
    """
    plain = text.replace("**", "^").replace(" per ", "/")
    for word in re.split(r"[\s()\[\],;:=*_]+", plain):
        unit = parse_unit(word)
        if unit and unit.quantity == "acceleration":
            return next((name for name, size in UNITS.items() if abs(unit.factor / size - 1.0) < 1e-9), unit.text)
    return ""


def size_of(unit: str) -> float:
    """Size of a unit of acceleration [m/s²]."""
    found = parse_unit(unit)
    return UNITS.get(unit, found.factor if found else 1.0)


def chosen(path: Path, names: Sequence[str], channel: int) -> int:
    """Index of the channel asked for; a ShakeError that lists them where there are several and none is chosen."""
    listed = ", ".join(f"{i + 1}: {shown(' '.join(name.split()))}" for i, name in enumerate(names))
    if channel == 0 and len(names) > 1:
        raise ShakeError(f"{path}: holds {len(names)} components; choose one with --channel ({listed})")
    if not 0 <= channel <= len(names):
        raise ShakeError(f"{path}: channel {channel} of a file that holds {len(names)}")
    return max(channel, 1) - 1


def checked(text: Text, time_step: float, acceleration: Array, unit: str, first_line: int) -> Array:
    """Acceleration in m/s² after the checks that hold for every format."""
    if not 1e-6 <= time_step <= 1.0:
        raise text.bad(first_line, f"time step {time_step:g} s is outside 1e-06 … 1 s")
    if acceleration.size < SHORTEST:
        raise text.bad(first_line, f"{acceleration.size} samples are fewer than {SHORTEST}")
    si = acceleration * size_of(unit)
    peak = float(np.max(np.abs(si)))
    if peak > PLAUSIBLE:
        place = int(np.argmax(np.abs(si)))
        raise text.bad(
            first_line, f"sample {place + 1} is {si[place]:.4g} m/s² ({si[place] / UNITS['g']:.3g} g): wrong unit?"
        )
    if peak == 0.0:
        raise text.bad(first_line, "every sample is zero")
    return np.asarray(si, dtype=np.float64)
