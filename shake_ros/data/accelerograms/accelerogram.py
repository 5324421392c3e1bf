"""An accelerogram in SI units, and what all its readers share: text, numbers, units, plausibility."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.quantities import ShakeError

Array = NDArray[np.float64]

UNITS = {"m/s2": 1.0, "cm/s2": 0.01, "g": 9.80665}
"""Size of each unit of acceleration in m/s²."""

LARGEST_FILE = 200_000_000
SHORTEST = 16
LARGEST_NUMBER = 1e40
"""Above every marker of an undefined value (1.7e38)."""
PLAUSIBLE = 1000.0
"""Largest acceleration [m/s²] that is taken for one (about 100 g)."""

SPELLINGS = {
    "g": "g",
    "gal": "cm/s2",
    "cm/s2": "cm/s2",
    "cm/s/s": "cm/s2",
    "cm/sec2": "cm/s2",
    "cm/sec/sec": "cm/s2",
    "m/s2": "m/s2",
    "m/s/s": "m/s2",
    "m/sec2": "m/s2",
    "m/sec/sec": "m/s2",
}

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?")


@dataclass(frozen=True)
class Accelerogram:
    """One channel of acceleration, uniform in time.

    time_step : [s].
    acceleration : (n,) [m/s²].
    name : station, component or file name.
    format : name in the table of formats.
    unit : as found in the file, "m/s2", "cm/s2" or "g".
    provenance : what the file says of itself, by name.
    warnings : what a user should know, one line each.
    """

    time_step: float
    acceleration: Array
    name: str
    format: str
    unit: str
    provenance: dict[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

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
            raise self.bad(line, f"{what} '{shown(text)}' is no plausible number")
        return value

    def whole(self, word: str, line: int, what: str, low: int, high: int) -> int:
        """A whole number within low … high."""
        text = word.strip()
        if not re.fullmatch(r"[-+]?\d{1,12}", text):
            raise self.bad(line, f"{what} '{shown(text)}' is not a whole number")
        if not low <= int(text) <= high:
            raise self.bad(line, f"{what} = {int(text)} is outside {low} … {high}")
        return int(text)


def shown(text: str) -> str:
    """At most 40 printable characters of a text, for a message.

    >>> shown("a\\x07b")
    'a?b'
    """
    clean = "".join(c if c.isprintable() else "?" for c in text)
    return clean if len(clean) <= 40 else clean[:37] + "..."


def read_text(path: Path) -> Text:
    """The lines of a file of 7-bit or Latin-1 text; CR CR LF, CR LF and CR end a line like LF, DOS end marks go."""
    try:
        if path.is_file() and path.stat().st_size > LARGEST_FILE:
            raise ShakeError(f"{path}: is larger than {LARGEST_FILE // 1_000_000} MB")
        raw = path.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, ShakeError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise ShakeError(f"{path}: cannot be read ({reason})") from None
    raw = raw.removeprefix(b"\xef\xbb\xbf").rstrip(b"\x1a\x00")
    if not raw.strip():
        raise ShakeError(f"{path}: is empty")
    strange = re.search(rb"[\x00-\x08\x0e-\x1f\x7f]", raw)
    if strange:
        place = strange.start()
        line = raw.count(b"\n", 0, place) + 1
        raise ShakeError(f"{path}, line {line}: is not text (byte 0x{raw[place]:02x} at {place})")
    text = raw.decode("latin-1").replace("\r\r\n", "\n").replace("\r\n", "\n").replace("\r", "\n")
    return Text(path, text.split("\n"))


def unit_named(text: str) -> str:
    """The unit of acceleration that a heading names, empty where it names none.

    >>> unit_named("ACCELERATION TIME HISTORY IN UNITS OF G"), unit_named("acc [cm/s^2]"), unit_named("acceleration")
    ('g', 'cm/s2', '')
    """
    plain = text.lower().replace("^", "").replace("**", "").replace("²", "2").replace(" per ", "/")
    for word in re.split(r"[\s()\[\],;:=*_]+", plain):
        if word.strip(".'") in SPELLINGS:
            return SPELLINGS[word.strip(".'")]
    return ""


def agreed_unit(text: Text, line: int, found: str, asked: str) -> str:
    """The unit the file names; an error where another one was asked for."""
    if asked and asked != found:
        raise text.bad(line, f"the file is in {found}, not in {asked}")
    return found


def fixed_columns(text: Text, first: int, count: int, width: int, per_line: int, what: str) -> tuple[Array, int]:
    """`count` numbers in columns of `width` characters, `per_line` to a line; with the index after their last line.

    Raises ShakeError where a line holds fewer or more than its share, or something that is not a number.
    """
    values = np.empty(count)
    line = first
    for done in range(0, count, per_line):
        row = text.line(line, f"sample {done + 1} of {count} {what}").rstrip()
        share = min(per_line, count - done)
        held = -(-len(row) // width)
        if held != share:
            raise text.bad(line, f"{held} columns of {width} characters where {share} {what} should be")
        for i in range(share):
            values[done + i] = text.number(row[i * width : (i + 1) * width], line, what)
        line += 1
    return values, line


def checked(text: Text, time_step: float, acceleration: Array, unit: str, first_line: int) -> Array:
    """Acceleration in m/s² after the checks that hold for every format."""
    if not 1e-5 <= time_step <= 1.0:
        raise text.bad(first_line, f"time step {time_step:g} s is outside 1e-05 … 1 s")
    if acceleration.size < SHORTEST:
        raise text.bad(first_line, f"{acceleration.size} samples are fewer than {SHORTEST}")
    si = acceleration * UNITS[unit]
    peak = float(np.max(np.abs(si)))
    if peak > PLAUSIBLE:
        place = int(np.argmax(np.abs(si)))
        raise text.bad(
            first_line, f"sample {place + 1} is {si[place]:.4g} m/s² ({si[place] / UNITS['g']:.3g} g): wrong unit?"
        )
    if peak == 0.0:
        raise text.bad(first_line, "every sample is zero")
    return np.asarray(si, dtype=np.float64)


def peak_warning(declared: float, found: float) -> tuple[str, ...]:
    """A warning where the peak that the header declares [m/s²] is not the one found [m/s²], within 1 %."""
    if abs(abs(declared) - found) <= 0.01 * found:
        return ()
    return (f"the header declares a peak of {abs(declared):.4g} m/s², the samples reach {found:.4g} m/s²",)
