"""Two columns: time and acceleration, separated by comma, semicolon, tab or blanks, with or without a heading.

More than two columns are read where the heading names one `time` and one `acceleration`. The unit comes from the
heading or from the caller; without either it is taken as m/s², with a warning. Lines that begin with # or % are
comments.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import Decimal

import numpy as np

from shake_ros.data.accelerograms.accelerogram import NUMBER, Accelerogram, Array, Text, checked, shown, unit_named

NAME = "two_columns"
HEADING_LINES = 20
TIME = re.compile(r"^\s*[\"']?(time|t)\b|^\s*[\"']?t_?s\b", re.IGNORECASE)
ACCELERATION = re.compile(r"^\s*[\"']?acc", re.IGNORECASE)


def split(line: str) -> list[str]:
    """The columns of a line.

    >>> split("0.01; 2.5"), split(" 1  -2 "), split("0,1")
    (['0.01', '2.5'], ['1', '-2'], ['0', '1'])
    """
    for mark in (";", ",", "\t"):
        if mark in line:
            words = [word.strip() for word in line.strip().split(mark)]
            return words[:-1] if words[-1] == "" else words
    return line.split()


def _is_row(line: str) -> bool:
    words = split(line)
    return len(words) >= 2 and all(NUMBER.fullmatch(word) for word in words)


def _is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip()[0] in "#%"


def recognise(lines: Sequence[str]) -> bool:
    """Whether a row of at least two numbers comes first, after comments and at most one heading."""
    rows = [line for line in lines[: HEADING_LINES + 1] if not _is_comment(line)]
    return any(_is_row(line) for line in rows[:2])


def read(text: Text, channel: int = 1, unit: str = "") -> Accelerogram:
    """The acceleration of a table of columns."""
    if channel != 1:
        raise text.bad(0, f"channel {channel} of a format that holds one")
    first = next(i for i, line in enumerate(text.lines) if not _is_comment(line) and _is_row(line))
    head = text.lines[:first]
    heading = next((line for line in reversed(head) if not _is_comment(line)), head[-1] if head else "")
    time_column, column, width = _columns(text, first, heading.lstrip("#% "))
    named = _unit_of_heading(heading, column) or next((u for line in head if (u := unit_named(line))), "")
    if unit and named and unit != named:
        raise text.bad(max(first - 1, 0), f"the heading says {named}, not {unit}")
    found = unit or named or "m/s2"
    time, values, first_digits = _table(text, first, time_column, column, width)
    step = _uniform_step(text, first, time, first_digits)
    return Accelerogram(
        time_step=step,
        acceleration=checked(text, step, values, found, first),
        name=text.path.stem,
        format=NAME,
        unit=found,
        provenance={f"header {i + 1}": line.strip() for i, line in enumerate(head) if line.strip()},
        warnings=() if unit or named else ("neither the file nor the caller names a unit, taken as m/s2",),
    )


def _columns(text: Text, first: int, heading: str) -> tuple[int, int, int]:
    """Columns of time and of acceleration, from 0, and their number."""
    width = len(split(text.lines[first]))
    names = split(heading)
    if len(names) == width:
        times = [i for i, name in enumerate(names) if TIME.match(name)]
        accelerations = [i for i, name in enumerate(names) if ACCELERATION.match(name)]
        if len(times) == 1 and len(accelerations) == 1:
            return times[0], accelerations[0], width
    if width != 2:
        raise text.bad(first, f"{width} columns without a heading that names one 'time' and one 'acceleration'")
    return 0, 1, 2


def _unit_of_heading(heading: str, column: int) -> str:
    """The unit that the heading of the acceleration column names."""
    names = split(heading)
    return unit_named(names[column]) if column < len(names) else ""


def _table(
    text: Text, first: int, time_column: int, column: int, width: int
) -> tuple[list[tuple[int, float]], Array, float]:
    """Times with their lines, accelerations, and the resolution to which times are printed [s]."""
    time: list[tuple[int, float]] = []
    values: list[float] = []
    finest = 0
    for line in range(first, len(text.lines)):
        if _is_comment(text.lines[line]):
            continue
        words = split(text.lines[line])
        if len(words) != width:
            raise text.bad(line, f"{len(words)} columns where {width} should be: '{shown(text.lines[line].strip())}'")
        time.append((line, text.number(words[time_column], line, "time")))
        values.append(text.number(words[column], line, "acceleration"))
        if len(time) <= 1000:
            exponent = Decimal(words[time_column].replace("D", "E").replace("d", "e")).as_tuple().exponent
            finest = min(finest, int(exponent))
    return time, np.asarray(values, dtype=np.float64), 10.0 ** max(finest, -15)


def _uniform_step(text: Text, first: int, rows: list[tuple[int, float]], resolution: float) -> float:
    """The time step [s]; an error where time stands still, goes back, or is not uniform to its printed digits."""
    if len(rows) < 2:
        raise text.bad(first, "one sample is not a record")
    time = np.array([value for _, value in rows])
    steps = np.diff(time)
    wrong = np.flatnonzero(steps <= 0.0)
    if wrong.size:
        i = int(wrong[0]) + 1
        raise text.bad(rows[i][0], f"time does not advance: {time[i]:g} s after {time[i - 1]:g} s")
    step = float(time[-1] - time[0]) / steps.size
    typical = float(np.median(steps))
    rounding = 1.01 * resolution if resolution <= 0.4 * typical else 0.0  # coarser digits cannot excuse anything
    tolerance = max(0.01 * typical, rounding)
    uneven = np.flatnonzero(np.abs(steps - typical) > tolerance)
    if uneven.size:
        i = int(uneven[0]) + 1
        raise text.bad(rows[i][0], f"time is not uniform: a step of {steps[i - 1]:g} s where {typical:g} s is usual")
    drift = np.abs(time - time[0] - step * np.arange(time.size))
    if np.max(drift) > max(0.01 * typical, rounding):
        i = int(np.argmax(drift))
        raise text.bad(rows[i][0], f"time is not uniform: {drift[i]:g} s off a step of {step:g} s")
    return step
