"""CDMG .V2: corrected records of one to three channels, each with acceleration, velocity and displacement.

Layout: A. F. Shakal and M. J. Huang, Standard Tape Format for CSMIP Strong-Motion Data Tapes, report OSMS 85-03.
Each channel has 25 lines of text, 100 integers (16I5), 100 reals (8F10.3), then for each of the three quantities one
line with count, step and unit and the values in eight columns of ten characters; "/&" ends the channel.
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
    unit_named,
)

NAME = "cdmg_v2"
DATA = re.compile(r"^\s*(\d+)\s+POINTS OF ACCEL DATA EQUALLY SPACED AT\s*(\S+)\s+SEC", re.IGNORECASE)
PEAK = re.compile(r"PEAK ACCELERATION\s*=\s*(\S+)\s+CM/SEC/SEC", re.IGNORECASE)
CHANNEL = re.compile(r"^\s*CORRECTED ACCELEROGRAM\b", re.IGNORECASE)


def recognise(lines: Sequence[str]) -> bool:
    """Whether the file starts with a corrected accelerogram in this format."""
    return bool(lines) and bool(CHANNEL.match(lines[0])) and "(FORMAT" not in lines[0].upper()


def read(text: Text, channel: int = 1, unit: str = "") -> Accelerogram:
    """The acceleration of one channel, counted from 1 in the order of the file."""
    starts = [i for i, line in enumerate(text.lines) if CHANNEL.match(line)]
    if not 1 <= channel <= len(starts):
        raise text.bad(0, f"channel {channel} of a file that holds {len(starts)}")
    first = starts[channel - 1]
    end = starts[channel] if channel < len(starts) else len(text.lines)
    place, match = next(((i, m) for i in range(first, end) if (m := DATA.match(text.lines[i]))), (end - 1, None))
    if match is None:
        raise text.bad(place, f"channel {channel} has no line 'POINTS OF ACCEL DATA EQUALLY SPACED AT … SEC'")
    count = text.whole(match[1], place, "number of samples", 1, 20_000_000)
    step = text.number(match[2], place, "time step")
    named = unit_named(text.lines[place].upper().split("UNITS", 1)[-1]) if "UNITS" in text.lines[place].upper() else ""
    if not named:
        raise text.bad(place, f"no known unit in '{shown(text.lines[place].strip()[-30:])}'")
    found = agreed_unit(text, place, named, unit)
    values, after = fixed_columns(text, place + 1, count, 10, 8, "samples")
    _ends_here(text, after, count)
    acceleration = checked(text, step, values, found, place)
    header = text.lines[first:place]
    declared = next((m[1] for line in header if (m := PEAK.search(line))), "")
    warnings: tuple[str, ...] = ()
    if declared:
        peak = text.number(declared, place, "declared peak") * UNITS["cm/s2"]
        warnings = peak_warning(peak, float(abs(acceleration).max()))
    titles = [line.strip() for line in header[:25] if line.strip()]
    label = next((" ".join(line.split()) for line in titles if re.match(r"CHAN\s+\d+", line, re.IGNORECASE)), "")
    return Accelerogram(
        time_step=step,
        acceleration=acceleration,
        name=f"{titles[6] if len(titles) > 6 else text.path.stem}, {label or f'channel {channel}'}",
        format=NAME,
        unit=found,
        provenance={"channel": f"{channel} of {len(starts)}"} | {f"header {i + 1}": t for i, t in enumerate(titles)},
        warnings=warnings,
    )


def _ends_here(text: Text, after: int, count: int) -> None:
    """The values must end where the next quantity, the end mark or the end of the file stands."""
    following = text.lines[after].strip() if after < len(text.lines) else ""
    if following and "POINTS OF" not in following.upper() and not following.startswith("/&"):
        raise text.bad(after, f"more than the {count} samples that line declares, or a damaged line")
