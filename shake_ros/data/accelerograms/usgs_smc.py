"""USGS .smc: 11 lines of text, 48 integers, 50 reals, comments, then eight columns of ten characters in cm/s².

Layout: USGS National Strong-Motion Project, "SMC-format data files". Used from the header: the number of
comments (integer 16), of samples (integer 17), samples per second (real 2), time and value of the largest and the
smallest acceleration (reals 29 to 32).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from shake_ros.data.accelerograms.accelerogram import (
    UNITS,
    Accelerogram,
    Text,
    agreed_unit,
    checked,
    fixed_columns,
    peak_warning,
    shown,
)

NAME = "usgs_smc"
TEXT_LINES, INTEGERS, REALS = 11, 48, 50
UNDEFINED = 1.7e38
ACCELERATION = ("0", "1", "2")
"""First character of line 1: raw, uncorrected or corrected acceleration (3 and up are other quantities)."""


def recognise(lines: Sequence[str]) -> bool:
    """Whether line 1 is a type of the format and line 12 holds its eight integers."""
    if len(lines) <= TEXT_LINES or not re.match(r"\s*\d\s+\S", lines[0]):
        return False
    return len(lines[0]) > 4 and len(lines[TEXT_LINES]) >= 80 and "-32768" in lines[TEXT_LINES]


def read(text: Text, channel: int = 1, unit: str = "") -> Accelerogram:
    """The acceleration of an .smc file."""
    if channel != 1:
        raise text.bad(0, f"channel {channel} of a format that holds one")
    if text.lines[0].strip()[0] not in ACCELERATION:
        raise text.bad(0, f"holds '{shown(text.lines[0].strip())}', not acceleration")
    found = agreed_unit(text, 0, "cm/s2", unit)
    integers, line = fixed_columns(text, TEXT_LINES, INTEGERS, 10, 8, "integers of the header")
    reals, line = fixed_columns(text, line, REALS, 15, 5, "reals of the header")
    comments = text.whole(f"{integers[15]:.0f}", TEXT_LINES + 1, "number of comments", 0, 10_000)
    count = text.whole(f"{integers[16]:.0f}", TEXT_LINES + 2, "number of samples", 1, 20_000_000)
    if not 1.0 <= reals[1] <= 1e5:
        raise text.bad(TEXT_LINES + 6, f"{reals[1]:g} samples per second is outside 1 … 100000")
    for i in range(line, line + comments):
        if not text.line(i, "the comments that the header declares").startswith("|"):
            raise text.bad(i, f"one of {comments} comments should stand here, beginning with '|'")
    values, after = fixed_columns(text, line + comments, count, 10, 8, "samples")
    _nothing_after(text, after, count)
    step = 1.0 / float(reals[1])
    acceleration = checked(text, step, values, found, line + comments)
    declared = [abs(float(v)) for v in (reals[29], reals[31]) if abs(v) < 0.99 * UNDEFINED]
    peak = float(abs(acceleration).max())
    return Accelerogram(
        time_step=step,
        acceleration=acceleration,
        name=text.lines[5].replace("station =", "").strip() or text.path.stem,
        format=NAME,
        unit=found,
        provenance={f"header {i + 1}": s for i in range(TEXT_LINES) if (s := text.lines[i].strip().strip("*"))},
        warnings=peak_warning(max(declared) * UNITS[found], peak) if declared else (),
    )


def _nothing_after(text: Text, after: int, count: int) -> None:
    """Refuse further numbers beyond the declared count."""
    for line in range(after, len(text.lines)):
        if text.lines[line].strip():
            raise text.bad(line, f"something follows the {count} samples that the header declares")
