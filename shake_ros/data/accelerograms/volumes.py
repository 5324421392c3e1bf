"""CSMIP and CDMG volumes 1 and 2, and COSMOS: text, integers, reals, then counted blocks of fixed columns.

Layouts: A. F. Shakal and M. J. Huang, Standard Tape Format for CSMIP Strong-Motion Data Tapes, report OSMS 85-03, and
what is distributed since (unit and format in the line above the numbers; volume 1 in g or g/10, evenly spaced or as
pairs of time and acceleration); COSMOS Strong Motion Data Format v1.20 (2001), whose step in ms is real 62.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from shake_ros.data.accelerograms.accelerogram import Component, Text, shown, unit_in

CORRECTED = re.compile(r"^\s*CORRECTED\s+ACCELEROGRAM\b", re.IGNORECASE)
UNCORRECTED = re.compile(r"^\s*UNCORRECTED\s+ACCELEROGRAM\b", re.IGNORECASE)
ELSEWHERE = re.compile(r"\(FORMAT|GNS SCIENCE", re.IGNORECASE)  # COSMOS, GeoNet
DATA = re.compile(
    r"^\s*(\d+)\s+(?:(?:RAW|UNCOR\w*)\s+)?(?:POINTS\s+OF\s+(?:\w+\s+)?)?ACCEL\w*\s+(?:DATA|POINTS|PTS)\b(.*)",
    re.IGNORECASE,
)
EVERY = re.compile(r"(?:AT|INTERVALS?\s+OF|EVERY)\s*([\d.]+(?:E-?\d+)?)\s*SEC", re.IGNORECASE)
RATE = re.compile(r"AT\s*([\d.]+)\s*(?:PTS|POINTS|SAMPLES|SPS|SMP)", re.IGNORECASE)
COLUMNS = re.compile(r"\(\s*(?:\d+P)?\s*(\d+)\s*[IFEGD]\s*(\d+)", re.IGNORECASE)
COUNT = re.compile(r"NO\.\s*OF\s*POINTS\s*=\s*(\d+)", re.IGNORECASE)
PEAK = re.compile(r"PEAK\s+ACCELERATION\s*=\s*(\S+)\s+CM/SEC/SEC", re.IGNORECASE)
LABEL = re.compile(r"CHAN\s+\d+.*", re.IGNORECASE)
TITLES, PAIRS_BEGIN = 25, 27  # lines of text of volume 2; line of volume 1 from which pairs stand without a heading

BLOCK = re.compile(r"^\s*(\w+)\s+(acceleration|velocity|displacement)\s*.*\(Format v", re.IGNORECASE)
COUNTED = re.compile(r"^\s*(\d+)\s+(\S+).*Format\s*=\s*\(\s*(?:\d+P)?\s*(\d+)\s*[IFEGD]\s*(\d+)", re.IGNORECASE)
COMMENTS = re.compile(r"^\s*(\d+)\s+Comment line", re.IGNORECASE)
COSMOS_TITLES = 13
STEP, SERIES_LENGTH, PEAK_PLACE = 61, 62, 63  # from 0, in the real header: [ms], [s], in the unit of the data
UNDEFINED = -999.0


def is_volume_1(lines: Sequence[str]) -> bool:
    """Whether the file starts with an uncorrected accelerogram of CSMIP or CDMG."""
    return bool(lines) and bool(UNCORRECTED.match(lines[0])) and not ELSEWHERE.search(lines[0])


def is_volume_2(lines: Sequence[str]) -> bool:
    """Whether the file starts with a corrected accelerogram of CSMIP or CDMG."""
    return bool(lines) and bool(CORRECTED.match(lines[0])) and not ELSEWHERE.search(lines[0])


def volume_1(text: Text) -> list[Component]:
    """The channels of a volume 1."""
    return _volume(text, UNCORRECTED)


def volume_2(text: Text) -> list[Component]:
    """The channels of a volume 2."""
    return _volume(text, CORRECTED)


def _volume(text: Text, begins: re.Pattern[str]) -> list[Component]:
    starts = [i for i, line in enumerate(text.lines) if begins.match(line)]
    ends = [*starts[1:], len(text.lines)]
    return [_of_volume(text, a, b, n) for n, (a, b) in enumerate(zip(starts, ends, strict=True), 1)]


def _of_volume(text: Text, first: int, end: int, number: int) -> Component:
    lines = text.lines[first:end]
    found = next(((i, m) for i, line in enumerate(lines) if (m := DATA.match(line))), None)
    if not found:
        return _pairs(text, first, end, number)
    place, match = first + found[0], found[1]
    rate, every = RATE.search(match[2]), EVERY.search(match[2])
    if not (rate or every):
        raise text.bad(place, f"no step in '{shown(match[2].strip())}'")
    step = text.number(every[1], place, "time step") if every else 1.0 / (text.number(rate[1], place, "rate") or 1e9)  # type: ignore[index]
    written = match[2][(every or rate).end() :]  # type: ignore[union-attr]
    columns = COLUMNS.search(written)
    unit = unit_in(COLUMNS.split(written)[0])
    if not unit:
        raise text.bad(place, f"no known unit in '{shown(written.strip())}'")
    per_line, width = (int(columns[1]), int(columns[2])) if columns else (8, 10)
    header = text.lines[first:place]
    peak = next((text.number(m[1], place, "declared peak") for line in header if (m := PEAK.search(line))), None)
    if peak is not None and unit != "cm/s2":
        peak = None
    count = text.whole(match[1], place, "number of samples")
    label, station = _names(text, header, number)
    return Component(
        label=label,
        name=station,
        step=step,
        unit=unit,
        line=place,
        first=place + 1,
        count=count,
        width=width,
        per_line=per_line,
        peak=peak,
        titles=tuple(header[:TITLES]),
    )


def _pairs(text: Text, first: int, end: int, number: int) -> Component:
    """A volume 1 whose samples stand beside their times, in ten columns of seven characters."""
    header = text.lines[first : min(end, first + PAIRS_BEGIN)]
    counted = next((m for line in header if (m := COUNT.search(line))), None)
    units = next((line for line in header if line.upper().lstrip().startswith("UNITS OF")), "")
    if not counted or not units:
        raise text.bad(end - 1, f"channel {number} has no line of the count, unit and step of its acceleration")
    unit = unit_in(units.upper().split("SEC AND", 1)[-1].split("MAX")[0])
    if not unit:
        raise text.bad(first, f"no known unit in '{shown(units.strip())}'")
    count = text.whole(counted[1], first, "number of samples")
    label, station = _names(text, header, number)
    return Component(
        label=label,
        name=station,
        step=0.0,
        unit=unit,
        line=first,
        first=first + PAIRS_BEGIN,
        count=count,
        width=7,
        per_line=10,
        columns=2,
        column=1,
        titles=tuple(header[:13]),
    )


def _names(text: Text, header: Sequence[str], number: int) -> tuple[str, str]:
    """Label and station of a channel."""
    titles = [line.strip() for line in header[:TITLES] if line.strip()]
    label = next((" ".join(line.split()) for line in titles if LABEL.match(line)), f"channel {number}")
    station = next((i for i, line in enumerate(titles) if line.upper().startswith("STATION NO")), -1)
    return label, titles[station + 1] if 0 <= station < len(titles) - 1 else text.path.stem


def is_cosmos(lines: Sequence[str]) -> bool:
    """Whether line 1 announces the format."""
    return bool(lines) and bool(BLOCK.match(lines[0]))


def cosmos(text: Text) -> list[Component]:
    """The blocks of acceleration of a COSMOS file."""
    starts = [i for i, line in enumerate(text.lines) if (m := BLOCK.match(line)) and m[2].lower() == "acceleration"]
    if not starts:
        raise text.bad(0, "holds velocity or displacement, not acceleration")
    return [_of_cosmos(text, first) for first in starts]


def _of_cosmos(text: Text, first: int) -> Component:
    size, per_line, width, line = _counted(text, first + COSMOS_TITLES, "integer header", 10_000)
    _, line = text.fixed(line, size, width, per_line, "integers")
    size, per_line, width, begin = _counted(text, line, "real header", 10_000)
    reals, line = text.fixed(begin, size, width, per_line, "reals")
    if size <= PEAK_PLACE:
        raise text.bad(begin - 1, f"{size} reals where at least {PEAK_PLACE + 1} should be")
    line = _after_comments(text, line)
    size, per_line, width, begin = _counted(text, line, "data")
    step, length = reals[STEP] / 1000.0, reals[SERIES_LENGTH]
    if step <= 0.0:
        raise text.bad(line, f"the real header gives no time step (real {STEP + 1} = {step * 1000.0:g} ms)")
    if length > 0.0 and abs(size * step - length) > max(2.0 * step, 0.01 * length):
        raise text.bad(line, f"{size} samples of {step:g} s do not make the declared {length:g} s")
    unit = unit_in(text.lines[line].lower().split("units", 1)[-1].split("format", 1)[0])
    if not unit:
        raise text.bad(line, f"no known unit in '{shown(text.lines[line].strip())}'")
    after = begin + -(-size // per_line)
    if not text.line(after, "the mark 'End-of-data'").lower().lstrip().startswith("end-of-data"):
        raise text.bad(after, f"'End-of-data' should follow the {size} samples that the header declares")
    titles = tuple(" ".join(text.lines[i].split()) for i in range(first, first + COSMOS_TITLES))
    name = re.sub(r"^Statn No:\s*\S+\s*", "", titles[4])
    label = next((m[0] for t in titles if (m := re.search(r"\bchan\w*\s*\d+.*", t, re.IGNORECASE))), titles[0])
    peak = None if reals[PEAK_PLACE] == UNDEFINED else reals[PEAK_PLACE]
    return Component(
        label=label,
        name=name,
        step=step,
        unit=unit,
        line=line,
        first=begin,
        count=size,
        width=width,
        per_line=per_line,
        peak=peak,
        titles=titles,
    )


def _counted(text: Text, line: int, what: str, most: int = 20_000_000) -> tuple[int, int, int, int]:
    """Number of values of a section, values to a line, characters to a value, and its first line of values."""
    content = text.line(line, f"the {what}")
    match = COUNTED.match(content)
    if not match:
        raise text.bad(line, f"count and format of the {what} cannot be read from '{shown(content.strip())}'")
    words = zip(
        (1, 3, 4), ("number of values", "values to a line", "characters to a value"), (most, 1000, 100), strict=True
    )
    count, per_line, width = (text.whole(match[i], line, f"{name} of the {what}", 1, top) for i, name, top in words)
    return count, per_line, width, line + 1


def _after_comments(text: Text, line: int) -> int:
    """Index of the line after the comments."""
    content = text.line(line, "the comments")
    match = COMMENTS.match(content)
    if not match:
        raise text.bad(line, f"number of comments cannot be read from '{shown(content.strip())}'")
    return comments(text, line + 1, text.whole(match[1], line, "number of comments", 0, 10_000))


def comments(text: Text, first: int, count: int) -> int:
    """Index of the line after `count` comments, each of which begins with '|'."""
    for i in range(first, first + count):
        if not text.line(i, "the comments that the header declares").startswith("|"):
            raise text.bad(i, f"one of {count} comments should stand here, beginning with '|'")
    return first + count
