"""Accelerograms as they are distributed → arrays in SI units; the formats stand in the table below.

To add a format: a function that finds its channels, and a line in the table, before the formats that would also take
its files. obspy and gmprocess read some of these (K-NET; COSMOS, SMC …), not .AT2 and V1 or V2 of every
age, and bring hundreds of megabytes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.recordings.accelerograms import lists, networks
from shake_ros.recordings.accelerograms.accelerogram import (
    LARGEST_FILE,
    UNITS,
    Accelerogram,
    Component,
    Text,
    read_channel,
    shown,
)
from shake_ros.recordings.tables import containers
from shake_ros.recordings.tables.containers import first_bytes, read_text

FORMATS: dict[str, Callable[[Text], list[Component] | None]] = {
    "knet": networks.knet,
    "esm_afad": networks.keyed,
    "geonet": networks.geonet,
    "usgs_smc": networks.smc,
    "cosmos_v2": networks.cosmos,
    "cdmg_v1": partial(networks.volume, begins=networks.UNCORRECTED),
    "cdmg_v2": partial(networks.volume, begins=networks.CORRECTED),
    "peer_at2": lists.listed,
}
"""What finds the channels of a file; None where the file is of another format."""


def read_accelerogram(path: Path | str, *, channel: int = 0, unit: str = "") -> Accelerogram:
    """Read one channel of an accelerogram; the format is recognised by the content.

    Parameters
    ----------
    path : the file.
    channel : which of several, from 1; 0: the file holds one.
    unit : m/s2, cm/s2 or g for a file that does not name its own; empty = as the file says.

    Raises
    ------
    ShakeError : one line with file, line and reason, for whatever cannot be read or is not plausible.
    """
    if unit and unit not in UNITS:
        raise unknown_name("unit", unit, UNITS)
    path = Path(path)
    head = first_bytes(path)
    other = containers.is_workbook(head) or containers.reader_of(path, head)
    text = Text(path, [] if other else read_text(path, LARGEST_FILE).split("\n"))
    for name, channels_of in FORMATS.items():
        if text.lines and (channels := channels_of(text)) is not None:
            return read_channel(text, channels, channel, unit, name)
    try:
        return lists.read(text, channel, unit)
    except ShakeError as error:
        if "no rows of numbers" not in str(error):
            raise
    first = next((line for line in text.lines if line.strip()), "")
    known = ", ".join((*FORMATS, lists.NAME))
    raise ShakeError(f"{path}: format not recognised (known: {known}); it begins '{shown(first.strip())}'")
