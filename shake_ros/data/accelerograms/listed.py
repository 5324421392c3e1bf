"""Accelerations one after the other under a line of their number and step: PEER .AT2, NGA text, `NPTS DT` text.

The number and the step come as "NPTS= 4000, DT= .0050 SEC", as "4000 .0050 NPTS, DT", as "NPTS, DT 4000 .0050", in two
lines, in words ("number of points", "time step", "sampling rate"), or as two bare numbers above. In g unless the header
says otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from shake_ros.data.accelerograms.accelerogram import Component, Text, shown, unit_in

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


def is_listed(lines: Sequence[str]) -> bool:
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


def listed(text: Text) -> list[Component]:
    """The channel of the file."""
    end, count, step = _count_and_step(text)
    place = _line_of(text, end)
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
            "", lines[1] if len(lines) > 1 else "", step, unit, max(place - 1, 0), first, count, titles=tuple(lines)
        )
    ]


def _line_of(text: Text, end: int) -> int:
    """Index of the line after character `end` of the head."""
    return "\n".join(text.lines[:HEADER_LINES])[:end].count("\n") + 1


def _numbers(line: str) -> bool:
    words = [word for word in re.split(r"[\s,;]+", line.strip()) if word]
    return (
        bool(words)
        and not re.match(r"[A-Za-z#%(]", words[0])
        and bool(re.match(r"[-+.\d]|nan|inf", words[0], re.IGNORECASE))
    )


def _count_and_step(text: Text) -> tuple[int, int | None, float]:
    """Where in the head the two end, the number of samples, None where the head does not give it, and the step [s]."""
    head = "\n".join(text.lines[:HEADER_LINES])
    for style in (*TOGETHER, BACKWARDS):
        if match := style.search(head):
            count, step = (match[2], match[1]) if style is BACKWARDS else (match[1], match[2])
            place = head[: match.end()].count("\n")
            return match.end(), text.whole(count, place, "NPTS"), text.number(step, place, "DT")
    points, step_said, rate = (pattern.search(head) for pattern in (POINTS_ALONE, STEP_ALONE, RATE_ALONE))
    said = step_said or rate
    if said:
        end = max(said.end(), points.end() if points else 0)
        place = head[:end].count("\n")
        value = text.number(said[1], place, "DT")
        count_said = text.whole(points[1], place, "NPTS") if points else None
        return end, count_said, value if step_said else 1.0 / max(value, 1e-9)
    for i, line in enumerate(text.lines[:HEADER_LINES]):
        if "NPTS" in line.upper():
            raise text.bad(i, f"count and step cannot be read from '{shown(line.strip())}'")
        if _bare(text.lines, i) and (match := BARE.match(line)):
            return len("\n".join(text.lines[: i + 1])), text.whole(match[1], i, "NPTS"), text.number(match[2], i, "DT")
    raise text.bad(min(HEADER_LINES, len(text.lines)) - 1, "no line with NPTS and DT so far")
