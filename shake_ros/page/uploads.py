"""A file from the operator's machine: an accelerogram becomes a reference, another table says how it is imported."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import yaml

from shake_ros.core.quantities import ShakeError
from shake_ros.data.accelerograms import read_accelerogram
from shake_ros.data.reference_program import build_program
from shake_ros.data.tables.proposal import Proposal, propose
from shake_ros.page.library import checked_name
from shake_ros.settings import find, read_yaml

LARGEST = 8 * 1024 * 1024  # bytes of an accelerogram
TEMPLATE = "earthquake"  # the reference whose band and limits it gets
TABLES = (".txt", ".csv", ".dat", ".tsv", ".lvm", ".asc", ".ascii", ".xlsx", ".tdms", ".mat")
SUFFIXES: tuple[str, ...] = (
    ".at2",
    ".v1",
    ".v1a",
    ".v2",
    ".v2a",
    ".v1c",
    ".v2c",
    ".raw",
    ".smc",
    ".acc",
    ".ns",
    ".ew",
    ".ud",
)
SUFFIXES += tuple(f"{end}{place}" for end in (".ns", ".ew", ".ud") for place in (1, 2)) + TABLES


def make_reference(
    folder: Path, name: str, content: bytes, unit: str, sample_time: float, channel: int = 0
) -> Path | Proposal:
    """Store the record, write a reference that plays it, and try it; what else a table holds, and how to import it.

    Parameters
    ----------
    folder : of uploads. name : of the file. content : its bytes. unit, channel : as of `read_accelerogram`.
    sample_time : of the generator [s].

    Raises
    ------
    ShakeError : it cannot be played, and is no table of other columns.
    """
    checked_name(name)
    if len(content) > LARGEST:
        raise ShakeError(f"{name}: larger than {LARGEST // 1024 // 1024} MiB")
    if Path(name).suffix.lower() not in SUFFIXES:
        raise ShakeError(f"{name}: not an accelerogram ({', '.join(SUFFIXES)})")
    folder.mkdir(parents=True, exist_ok=True)
    record, reference = folder / name, folder / f"{Path(name).stem}.yaml"
    record.write_bytes(content)
    try:
        read_accelerogram(record, unit=unit, channel=channel)
        template = read_yaml(find("reference", TEMPLATE))
        settings = {**template, "record": str(record), "unit": unit, "channel": channel}
        reference.write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")
        build_program(str(reference), sample_time)
    except ShakeError as error:
        other = _table(record)
        record.unlink(missing_ok=True)
        reference.unlink(missing_ok=True)
        if other:
            return other
        raise ShakeError(str(error).replace(f"{folder}/", "").replace(" with --channel", "")) from None
    return reference


def _table(file: Path) -> Proposal | None:
    """The columns of a table that holds a command or a position; None where it is none."""
    try:
        found = propose(file)
    except ShakeError:
        return None
    found = replace(found, path=Path(file.name), arguments=(file.name, *found.arguments[1:]))
    return found if {"command", "position"} & {column.could_be for column in found.columns} else None
