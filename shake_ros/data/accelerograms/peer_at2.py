"""PEER .AT2: a few lines of title, the unit, the count and step, then columns of acceleration.

The count and step come as "NPTS= 4000, DT= .0050 SEC", as "4000 .0050 NPTS, DT" or as "NPTS, DT 4000 .0050",
usually on line 4, sometimes one line earlier or later. Five or eight columns, in g unless the header says otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from shake_ros.data.accelerograms.accelerogram import (
    Accelerogram,
    Text,
    agreed_unit,
    checked,
    shown,
    unit_named,
)

NAME = "peer_at2"
HEADER_LINES = 12
_VALUE = r"(\d*\.?\d+(?:[EeDd][-+]?\d+)?)"
STYLES = (
    re.compile(rf"NPTS\s*=\s*(\d+)\s*,?\s*DT\s*=\s*{_VALUE}", re.IGNORECASE),
    re.compile(rf"^\s*(\d+)\s*,?\s+{_VALUE}\s*,?\s*NPTS\s*,\s*DT", re.IGNORECASE),
    re.compile(rf"NPTS\s*,\s*DT\s*[:=]?\s*(\d+)\s*,?\s+{_VALUE}", re.IGNORECASE),
)


def recognise(lines: Sequence[str]) -> bool:
    """Whether the first lines speak of NPTS and DT, or of PEER."""
    head = " ".join(lines[:HEADER_LINES]).upper()
    return ("NPTS" in head and "DT" in head) or "PEER STRONG MOTION" in head or "PEER NGA" in head


def read(text: Text, channel: int = 1, unit: str = "") -> Accelerogram:
    """The acceleration of a PEER file."""
    if channel != 1:
        raise text.bad(0, f"channel {channel} of a format that holds one")
    place, count, step = _count_and_step(text)
    head = list(text.lines[:place])
    titles = " ".join(head)
    if re.search(r"\b(VELOCITY|DISPLACEMENT)\s+TIME", titles, re.IGNORECASE):
        raise text.bad(0, "holds velocity or displacement, not acceleration")
    unit_line = next((i for i, line in enumerate(head) if "UNITS" in line.upper()), place)
    named = unit_named(re.split(r"UNITS\s+OF", head[unit_line], flags=re.IGNORECASE)[-1]) if unit_line < place else ""
    if unit_line < place and not named:
        raise text.bad(unit_line, f"unknown unit in '{shown(head[unit_line].strip())}'")
    warnings = () if named else ("the header names no unit, taken as g",)
    found = agreed_unit(text, unit_line, named or "g", unit)
    values = _values(text, place + 1, count)
    titles_found = [line.strip() for line in head if line.strip()]
    return Accelerogram(
        time_step=step,
        acceleration=checked(text, step, values, found, place),
        name=titles_found[1] if len(titles_found) > 1 else text.path.stem,
        format=NAME,
        unit=found,
        provenance={f"header {i + 1}": line for i, line in enumerate(titles_found)},
        warnings=warnings,
    )


def _count_and_step(text: Text) -> tuple[int, int, float]:
    """Index of the line with NPTS and DT, and the two."""
    for place, line in enumerate(text.lines[:HEADER_LINES]):
        for style in STYLES:
            match = style.search(line)
            if match:
                count = text.whole(match[1], place, "NPTS", 1, 20_000_000)
                return place, count, text.number(match[2], place, "DT")
        if "NPTS" in line.upper():
            raise text.bad(place, f"count and step cannot be read from '{shown(line.strip())}'")
    raise text.bad(min(HEADER_LINES, len(text.lines)) - 1, "no line with NPTS and DT so far")


def _values(text: Text, first: int, count: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """All numbers from line `first` on, which must be `count`."""
    values: list[float] = []
    last = first
    for line in range(first, len(text.lines)):
        words = text.lines[line].split()
        if words:
            values.extend(text.number(word, line, "acceleration") for word in words)
            last = line
    if len(values) != count:
        raise text.bad(last, f"{len(values)} samples where the header declares NPTS = {count}")
    return np.asarray(values, dtype=np.float64)
