"""Accelerograms as they are distributed → arrays in SI units; the formats stand in the table below.

To add a format: what recognises its lines and what finds its channels, and a line in the table, before the formats that
would also take its files. obspy and gmprocess read some of these (K-NET; COSMOS, SMC …), not .AT2 and V1 or V2 of every
age, and bring hundreds of megabytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.accelerograms import lists, networks
from shake_ros.data.accelerograms.accelerogram import (
    LARGEST_FILE,
    UNITS,
    Accelerogram,
    Component,
    Text,
    read_channel,
    shown,
)
from shake_ros.data.tables import containers
from shake_ros.data.tables.containers import first_bytes, read_text


class Format(NamedTuple):
    """How a format is recognised by its lines, and the function that finds its channels."""

    recognise: Callable[[Sequence[str]], bool]
    channels: Callable[[Text], list[Component]]


FORMATS: dict[str, Format] = {
    "knet": Format(networks.is_knet, networks.knet),
    "esm_afad": Format(networks.is_keyed, networks.keyed),
    "geonet": Format(networks.is_geonet, networks.geonet),
    "usgs_smc": Format(networks.is_smc, networks.smc),
    "cosmos_v2": Format(networks.is_cosmos, networks.cosmos),
    "cdmg_v1": Format(
        lambda lines: networks.is_volume(lines, networks.UNCORRECTED),
        lambda text: networks.volume(text, networks.UNCORRECTED),
    ),
    "cdmg_v2": Format(
        lambda lines: networks.is_volume(lines, networks.CORRECTED),
        lambda text: networks.volume(text, networks.CORRECTED),
    ),
    "peer_at2": Format(lists.is_listed, lists.listed),
}


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
    for name, form in FORMATS.items():
        if text.lines and form.recognise(text.lines):
            return read_channel(text, form.channels(text), channel, unit, name)
    try:
        return lists.read(text, channel, unit)
    except ShakeError as error:
        if "no rows of numbers" not in str(error):
            raise
    first = next((line for line in text.lines if line.strip()), "")
    known = ", ".join((*FORMATS, lists.NAME))
    raise ShakeError(f"{path}: format not recognised (known: {known}); it begins '{shown(first.strip())}'")
