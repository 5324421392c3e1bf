"""Accelerograms without a network's header: a table of columns, or numbers one after the other under a line.

Columns of time and acceleration are found by their units and names, as loggers and spreadsheets write them; without
either, two columns are time and acceleration. The unit comes from the heading or from the caller; without either it is
taken as m/s², with a warning.

Numbers under a line (PEER .AT2, NGA text, `NPTS DT` text) have their count and step as "NPTS= 4000, DT= .0050 SEC", as
"4000 .0050 NPTS, DT", as "NPTS, DT 4000 .0050", in two lines, in words ("number of points", "time step", "sampling
rate"), or as two bare numbers above. In g unless the header says otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms.accelerogram import (
    Accelerogram,
    Array,
    Component,
    Text,
    checked,
    chosen,
    shown,
    unit_in,
)
from shake_ros.recordings.tables.table import ColumnTable, read_table, table_of

NAME = "two_columns"
AT_LEAST = 0.5  # step of a time without a unit from which it may be in milliseconds [s]


def read(text: Text, channel: int, unit: str) -> Accelerogram:
    """The acceleration of a table of columns."""
    table = table_of(text.path, text.lines) if text.lines else read_table(text.path)
    time_place, place = _places(table, channel)
    time, values = table.read([time_place, place])
    for name, column in (("time", time), ("acceleration", values)):
        if not np.isfinite(column).all():
            row = int(np.argmax(~np.isfinite(column)))
            raise ShakeError(f"{table.path}, {table.line(row)}: {name} 'nan' is not a finite number")
    found, warnings = _unit(table, place, unit)
    step = _step(table, time_place, time)
    return Accelerogram(
        time_step=step,
        acceleration=checked(text, step, values, found, 0),
        name=table.path.stem,
        format=NAME,
        unit=found,
        warnings=warnings,
    )


def _places(table: ColumnTable, channel: int) -> tuple[int, int]:
    """Columns of time and acceleration."""
    kinds = {place: table.quantity(place) for place in table.numbers}
    times = [place for place, kind in kinds.items() if kind == "time"]
    several = [place for place, kind in kinds.items() if kind == "acceleration"]
    if not times and "index" in kinds.values():
        name = table.name(next(place for place, kind in kinds.items() if kind == "index"))
        raise ShakeError(
            f"{table.path}: column '{name}' counts samples and no column holds the time: name the step in a "
            "line 'NPTS= …, DT= … SEC' above one column, or write the time"
        )
    if len(kinds) == 2 and not times:
        times = [next(place for place in kinds if place not in several)]
    if len(kinds) == 2 and not several:
        several = [next(place for place in kinds if place not in times)]
        if kinds[several[0]]:
            raise ShakeError(
                f"{table.path}: column '{table.name(several[0])}' holds {kinds[several[0]]}, not acceleration"
            )
    if len(times) != 1 or not several:
        held = ", ".join(f"'{table.name(place)}'" for place in kinds)
        raise ShakeError(
            f"{table.path}: {len(kinds)} columns without a heading that names one 'time' and one "
            f"'acceleration' ({held})"
        )
    names = [table.name(place) for place in several]
    return times[0], several[chosen(table.path, names, channel)]


def _unit(table: ColumnTable, place: int, asked: str) -> tuple[str, tuple[str, ...]]:
    """The unit of the acceleration, and a warning where it is assumed."""
    unit = table.unit(place)
    named = unit_in(f"[{unit.text}]") if unit else next((u for line in table.header if (u := unit_in(line))), "")
    if asked and named and asked != named:
        raise ShakeError(f"{table.path}: the heading says {named}, not {asked}")
    if asked or named:
        return asked or named, ()
    return "m/s2", ("neither the file nor the caller names a unit, taken as m/s2",)


def _step(table: ColumnTable, place: int, time: Array) -> float:
    """The time step [s]; an error where time stands still, goes back, or is not uniform to its printed digits."""
    if len(time) < 2:
        raise ShakeError(f"{table.path}, {table.line(0)}: one sample is not an accelerogram")
    unit = table.unit(place)
    steps = np.diff(time)
    wrong = np.flatnonzero(steps <= 0.0)
    if wrong.size:
        i = int(wrong[0]) + 1
        raise ShakeError(f"{table.path}, {table.line(i)}: time does not advance: {time[i]:g} s after {time[i - 1]:g} s")
    step, typical = float(time[-1] - time[0]) / steps.size, float(np.median(steps))
    if unit is None and AT_LEAST <= typical:
        raise ShakeError(
            f"{table.path}: time step {typical:g} without a unit: write 'time [s]' or 'time [ms]' above the column"
        )
    digits = next((d for d in range(13) if np.allclose(np.round(time[:1000], d), time[:1000], 0.0, 1e-3 * typical)), 13)
    resolution = 1.01 * 10.0**-digits
    tolerance = max(0.01 * typical, resolution if resolution <= 0.41 * typical else 0.0)  # coarser excuses nothing
    uneven = np.flatnonzero(np.abs(steps - typical) > tolerance)
    if uneven.size:
        i = int(uneven[0]) + 1
        raise ShakeError(
            f"{table.path}, {table.line(i)}: time is not uniform: a step of {steps[i - 1]:g} s where {typical:g} s "
            "is usual"
        )
    drift = np.abs(time - time[0] - step * np.arange(time.size))
    if np.max(drift) > tolerance:
        i = int(np.argmax(drift))
        raise ShakeError(f"{table.path}, {table.line(i)}: time is not uniform: {drift[i]:g} s off a step of {step:g} s")
    return step * (unit.factor if unit else 1.0)


HEADER_LINES = 40
_VALUE = r"(\d*\.?\d+(?:[EeDd][-+]?\d+)?|\d+\.)"
_POINTS = r"(?:NPTS|NPOINTS|N_?PTS|NDATA|(?:NUMBER|NO\.?|NUM) +OF +(?:DATA +)?(?:POINTS|SAMPLES|DATA|PTS)|SAMPLES)"
_STEP = r"(?:DT|D_?T|DELTA ?T|TIME +(?:STEP|INTERVAL|INCREMENT)|SAMPLING +(?:INTERVAL|PERIOD|STEP)|TIMESTEP)"
_BETWEEN = r"\s*(?:\(\s*\w+\s*\))?\s*[=:]?\s*"
TOGETHER = (  # number of samples and step in one place
    re.compile(rf"{_POINTS}{_BETWEEN}(\d+)\s*[,;]?\s*{_STEP}{_BETWEEN}{_VALUE}", re.IGNORECASE),
    re.compile(
        rf"^[ \t#%]*(\d+)[ \t]*[,;]?[ \t]+{_VALUE}[ \t]*[,;:]?[ \t]*\(?{_POINTS}\s*[,;&/]?\s*{_STEP}",
        re.IGNORECASE | re.MULTILINE,
    ),
    re.compile(
        rf"{_POINTS}\s*[,;&/]?\s*{_STEP}[ \t]*(?:\(\w+\))?[ \t]*[:=]?\s*(\d+)[ \t]*[,;]?[ \t]+{_VALUE}", re.IGNORECASE
    ),
)
BACKWARDS = re.compile(rf"{_STEP}{_BETWEEN}{_VALUE}\s*(?:SEC\w*|S)?\s*[,;]?\s*{_POINTS}{_BETWEEN}(\d+)", re.IGNORECASE)
POINTS_ALONE = re.compile(rf"{_POINTS}{_BETWEEN}(\d+)", re.IGNORECASE)
STEP_ALONE = re.compile(rf"\b{_STEP}{_BETWEEN}{_VALUE}", re.IGNORECASE)
RATE_ALONE = re.compile(rf"SAMPLING +(?:RATE|FREQUENCY|FREQ\.?){_BETWEEN}{_VALUE}", re.IGNORECASE)
BARE = re.compile(
    r"^\s*(\d{2,8})\s*[,;]?\s+(0?\.\d+(?:[EeDd][-+]?\d+)?|\d[\d.]*[EeDd]-\d+)\s*(?:SEC|S)?\s*$", re.IGNORECASE
)


def _is_listed(lines: Sequence[str]) -> bool:
    """Whether the first lines give a number of samples and a step, or speak of PEER."""
    head = "\n".join(lines[:HEADER_LINES])
    upper = head.upper()
    if ("NPTS" in upper and "DT" in upper) or "PEER STRONG MOTION" in upper or "PEER NGA" in upper:
        return True
    rows = [i for i, line in enumerate(lines[:HEADER_LINES]) if line.strip()]
    single = bool(rows) and len(lines[rows[-1]].split()) == 1
    if STEP_ALONE.search(head) or RATE_ALONE.search(head):
        return single or bool(POINTS_ALONE.search(head))
    return any(_bare(lines, i) for i in rows[:5])


def _bare(lines: Sequence[str], place: int) -> bool:
    """Whether a line of two bare numbers gives the number and step of those that follow."""
    match = BARE.match(lines[place])
    return match is not None and sum(len(line.split()) for line in lines[place + 1 :]) in (
        int(match[1]),
        2 * int(match[1]),
    )


def listed(text: Text) -> list[Component] | None:
    """The channel of the file."""
    if not _is_listed(text.lines):
        return None
    place, count, step = _count_and_step(text)
    first = next((i for i in range(place, len(text.lines)) if _numbers(text.lines[i])), len(text.lines))
    head = list(text.lines[:first])
    titles = " ".join(head)
    if re.search(r"\b(VELOCITY|DISPLACEMENT)\s+(TIME|HIST)", titles, re.IGNORECASE):
        raise text.bad(0, "holds velocity or displacement, not acceleration")
    unit_line = next((i for i, line in enumerate(head) if "UNIT" in line.upper()), -1)
    unit = unit_in(re.split(r"UNITS?(?:\s+OF)?", head[unit_line], flags=re.IGNORECASE)[-1]) if unit_line >= 0 else ""
    if unit_line >= 0 and not unit:
        raise text.bad(unit_line, f"unknown unit in '{shown(head[unit_line].strip())}'")
    unit = unit or next((u for line in head if re.search(r"acc", line, re.IGNORECASE) and (u := unit_in(line))), "")
    lines = [line.strip() for line in head if line.strip()]
    return [
        Component(
            label="",
            name=lines[1] if len(lines) > 1 else "",
            step=step,
            unit=unit,
            line=max(place - 1, 0),
            first=first,
            count=count,
        )
    ]


def _numbers(line: str) -> bool:
    words = [word for word in re.split(r"[\s,;]+", line.strip()) if word]
    return (
        bool(words)
        and not re.match(r"[A-Za-z#%(]", words[0])
        and bool(re.match(r"[-+.\d]|nan|inf", words[0], re.IGNORECASE))
    )


def _count_and_step(text: Text) -> tuple[int, int | None, float]:
    """Line behind the two, the number of samples, None where the head does not give it, and the step [s]."""
    head = "\n".join(text.lines[:HEADER_LINES])
    for style in (*TOGETHER, BACKWARDS):
        if match := style.search(head):
            count, step = (match[2], match[1]) if style is BACKWARDS else (match[1], match[2])
            place = head[: match.end()].count("\n")
            return place + 1, text.whole(count, place, "NPTS"), text.number(step, place, "DT")
    points, step_said, rate = (pattern.search(head) for pattern in (POINTS_ALONE, STEP_ALONE, RATE_ALONE))
    said = step_said or rate
    if said:
        end = max(said.end(), points.end() if points else 0)
        place = head[:end].count("\n")
        value = text.number(said[1], place, "DT")
        count_said = text.whole(points[1], place, "NPTS") if points else None
        return place + 1, count_said, value if step_said else 1.0 / max(value, 1e-9)
    for i, line in enumerate(text.lines[:HEADER_LINES]):
        if "NPTS" in line.upper():
            raise text.bad(i, f"count and step cannot be read from '{shown(line.strip())}'")
        if _bare(text.lines, i) and (match := BARE.match(line)):
            return i + 1, text.whole(match[1], i, "NPTS"), text.number(match[2], i, "DT")
    raise text.bad(min(HEADER_LINES, len(text.lines)) - 1, "no line with NPTS and DT above it")
