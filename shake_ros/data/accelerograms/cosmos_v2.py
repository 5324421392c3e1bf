"""COSMOS .V2, .V2c: text, 100 integers, 100 reals, comments, then the values in the format that the file states.

Layout: COSMOS Strong Motion Data Format v1.20 (2001). A file may hold several blocks (channels, or acceleration,
velocity and displacement of one); the acceleration blocks are counted as channels. The step in ms is real 62.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from shake_ros.data.accelerograms.accelerogram import (
    UNITS,
    Accelerogram,
    Text,
    agreed_unit,
    checked,
    fixed_columns,
    peak_warning,
    shown,
    unit_named,
)

NAME = "cosmos_v2"
BLOCK = re.compile(r"^\s*(\w+)\s+(acceleration|velocity|displacement)\s*.*\(Format v", re.IGNORECASE)
COUNTED = re.compile(r"^\s*(\d+)\s+(\S+).*Format\s*=\s*\(\s*(\d+)\s*[IFEGD]\s*(\d+)", re.IGNORECASE)
COMMENTS = re.compile(r"^\s*(\d+)\s+Comment line", re.IGNORECASE)
TEXT_LINES = 13
STEP, SERIES_LENGTH, PEAK = 61, 62, 63
"""Places, from 0, in the real header: step [ms], length [s], peak in the unit of the data."""
UNDEFINED = -999.0


class Section(NamedTuple):
    """A counted section: number of values, values to a line, characters to a value, its line."""

    size: int
    per_line: int
    width: int
    line: int


def recognise(lines: Sequence[str]) -> bool:
    """Whether line 1 announces the format."""
    return bool(lines) and bool(BLOCK.match(lines[0]))


def read(text: Text, channel: int = 1, unit: str = "") -> Accelerogram:
    """The acceleration of one block, counted from 1 among the acceleration blocks of the file."""
    starts = [i for i, line in enumerate(text.lines) if (m := BLOCK.match(line)) and m[2].lower() == "acceleration"]
    if not 1 <= channel <= len(starts):
        raise text.bad(0, f"channel {channel} of a file that holds {len(starts)} of acceleration")
    first = starts[channel - 1]
    integers = _section(text, first + TEXT_LINES, "integer header", 10_000)
    _, line = fixed_columns(text, integers.line + 1, integers.size, integers.width, integers.per_line, "integers")
    reals = _section(text, line, "real header", 10_000)
    header, line = fixed_columns(text, reals.line + 1, reals.size, reals.width, reals.per_line, "reals")
    if header.size <= PEAK:
        raise text.bad(reals.line, f"{header.size} reals where at least {PEAK + 1} should be")
    line = _skip_comments(text, line)
    data = _section(text, line, "data", 20_000_000)
    step = float(header[STEP]) / 1000.0
    _step_agrees(text, step, data, float(header[SERIES_LENGTH]))
    named = unit_named(text.lines[data.line].lower().split("units", 1)[-1].split("format", 1)[0].replace("(", " ("))
    if not named:
        raise text.bad(data.line, f"no known unit in '{shown(text.lines[data.line].strip())}'")
    found = agreed_unit(text, data.line, named, unit)
    values, after = fixed_columns(text, data.line + 1, data.size, data.width, data.per_line, "samples")
    if not text.line(after, "the mark 'End-of-data'").lower().lstrip().startswith("end-of-data"):
        raise text.bad(after, f"'End-of-data' should follow the {data.size} samples that the header declares")
    acceleration = checked(text, step, values, found, data.line)
    peak = float(header[PEAK])
    return Accelerogram(
        time_step=step,
        acceleration=acceleration,
        name=re.sub(r"^Statn No:\s*\S+\s*", "", " ".join(text.lines[first + 4].split())),
        format=NAME,
        unit=found,
        provenance=_provenance(text, first, channel, len(starts)),
        warnings=() if peak == UNDEFINED else peak_warning(peak * UNITS[found], float(abs(acceleration).max())),
    )


def _section(text: Text, line: int, what: str, most: int) -> Section:
    """Count and format of a section from its line."""
    content = text.line(line, f"the {what}")
    match = COUNTED.match(content)
    if not match:
        raise text.bad(line, f"count and format of the {what} cannot be read from '{shown(content.strip())}'")
    count = text.whole(match[1], line, f"number of values of the {what}", 1, most)
    per_line = text.whole(match[3], line, "values to a line", 1, 1000)
    return Section(count, per_line, text.whole(match[4], line, "characters to a value", 1, 100), line)


def _skip_comments(text: Text, line: int) -> int:
    """Index of the line after the comments."""
    content = text.line(line, "the comments")
    match = COMMENTS.match(content)
    if not match:
        raise text.bad(line, f"number of comments cannot be read from '{shown(content.strip())}'")
    count = text.whole(match[1], line, "number of comments", 0, 10_000)
    for i in range(line + 1, line + 1 + count):
        if not text.line(i, "the comments that the header declares").startswith("|"):
            raise text.bad(i, f"one of {count} comments should stand here, beginning with '|'")
    return line + 1 + count


def _step_agrees(text: Text, step: float, data: Section, length: float) -> None:
    """The step must be given, and count times step must be the declared length where there is one."""
    if step <= 0.0:
        raise text.bad(data.line, f"the real header gives no time step (real {STEP + 1} = {step * 1000.0:g} ms)")
    if length > 0.0 and abs(data.size * step - length) > max(2.0 * step, 0.01 * length):
        raise text.bad(data.line, f"{data.size} samples of {step:g} s do not make the declared {length:g} s")


def _provenance(text: Text, first: int, channel: int, channels: int) -> dict[str, str]:
    """The lines of text by number."""
    lines = [" ".join(text.lines[i].split()) for i in range(first, first + TEXT_LINES)]
    return {"channel": f"{channel} of {channels}"} | {f"header {i + 1}": line for i, line in enumerate(lines)}
