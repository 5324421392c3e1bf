"""Accelerograms as they are distributed → arrays in SI units. One file per format, listed in the table below.

To add a format: a file with `NAME`, `recognise(lines)` and `read(text, channel, unit)`, and a line in the table, before
the formats that would also take its files.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.accelerograms import cdmg_v2, cosmos_v2, peer_at2, two_columns, usgs_smc
from shake_ros.data.accelerograms.accelerogram import UNITS, Accelerogram, Text, read_text, shown


class Format(NamedTuple):
    """How a format is told from its lines, and how it is read."""

    recognise: Callable[[Sequence[str]], bool]
    read: Callable[[Text, int, str], Accelerogram]


FORMATS: dict[str, Format] = {
    peer_at2.NAME: Format(peer_at2.recognise, peer_at2.read),
    usgs_smc.NAME: Format(usgs_smc.recognise, usgs_smc.read),
    cosmos_v2.NAME: Format(cosmos_v2.recognise, cosmos_v2.read),
    cdmg_v2.NAME: Format(cdmg_v2.recognise, cdmg_v2.read),
    two_columns.NAME: Format(two_columns.recognise, two_columns.read),
}


def read_accelerogram(path: Path | str, *, channel: int = 1, unit: str = "") -> Accelerogram:
    """Read one channel of an accelerogram; the format is told by the content.

    Parameters
    ----------
    path : the file.
    channel : which of several, from 1.
    unit : m/s2, cm/s2 or g for a file that does not name its own; empty = as the file says.

    Raises
    ------
    ShakeError : one line with file, line and reason, for whatever cannot be read or is not plausible.
    """
    if unit and unit not in UNITS:
        raise unknown_name("unit", unit, UNITS)
    text = read_text(Path(path))
    for form in FORMATS.values():
        if form.recognise(text.lines):
            return form.read(text, channel, unit)
    first = next((line for line in text.lines if line.strip()), "")
    raise ShakeError(f"{path}: format not recognised (known: {', '.join(FORMATS)}); it begins '{shown(first.strip())}'")
