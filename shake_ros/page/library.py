"""The recordings of this laboratory (length, what was played, peaks, tracking, findings) and files from its operators.

Beside a recording NAME stands NAME.json: its note and what ran, written when it is closed, and the summary of what it
holds, computed when it is first looked at.

An uploaded accelerogram becomes a reference; of another table `make_reference` says how it is imported.
"""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.bags import read_table_recording
from shake_ros.recordings.reference_file import build_program
from shake_ros.recordings.tables.proposal import Proposal, propose
from shake_ros.settings import find, read_yaml

NAME = re.compile(r"[A-Za-z0-9][\w.-]{0,79}")
SUMMARY = "summary"


def checked_name(name: str) -> str:
    """A name that may become a file's: letters, digits, _ . -, no path; ShakeError for any other.

    >>> checked_name("run_1")
    'run_1'
    """
    if not NAME.fullmatch(name) or ".." in name:
        raise ShakeError(
            f"name {name[:60]!r}: letters, digits, '_', '-' and '.' alone, beginning with a letter or digit"
        )
    return name


def _rms(values: npt.NDArray[np.float64]) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def summary(path: Path) -> dict[str, Any]:
    """What a recording holds; its reason where it cannot be read."""
    try:
        found = read_table_recording(path)
    except ShakeError as error:
        return {"error": str(error)}
    from shake_ros.recordings.fit_records import finding_lines

    entry: dict[str, Any] = {
        "seconds": len(found) * found.sample_time,
        "samples": len(found),
        "rate": 1.0 / found.sample_time,
        "findings": list(finding_lines(found))[:20],
    }
    if found.position_measured:
        entry["peak_position"] = float(np.nanmax(np.abs(found.position)))
    if found.acceleration is not None:
        entry["peak_acceleration"] = float(np.nanmax(np.abs(found.acceleration)))
    if found.reference is not None:
        entry["peak_velocity"] = float(np.nanmax(np.abs(found.reference[:, 1])))
    if found.reference is not None and found.position_measured:
        entry["error_rms"] = _rms(found.reference[:, 0] - found.position)
    return entry


class Library:
    """The folder `recordings` below the laboratory's folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._guard = threading.Lock()

    def path(self, name: str) -> Path:
        """A recording by its name; ShakeError where there is none."""
        found = self.folder / checked_name(name)
        if not found.is_dir():
            raise ShakeError(f"no recording {name}")
        return found

    def take(self, path: Path) -> None:
        """Show a recording of a result folder as well, under the name of both."""
        link = self.folder / f"{path.parent.parent.name}_{path.name}"
        link.unlink(missing_ok=True)  # of results that have been removed
        link.symlink_to(path.resolve())

    def note(self, name: str, words: Mapping[str, Any]) -> None:
        """Write down what ran."""
        (self.folder / f"{checked_name(name)}.json").write_text(json.dumps(dict(words), indent=1), encoding="utf-8")

    def entries(self, running: str = "") -> list[dict[str, Any]]:
        """All recordings but the one that is being made, the newest first."""
        with self._guard:
            found = [self._entry(path) for path in self.folder.glob("*/") if path.name != running]
        return sorted(found, key=lambda one: -float(one["made"]))

    def _entry(self, path: Path) -> dict[str, Any]:
        beside = path.parent / f"{path.name}.json"
        try:
            words = json.loads(beside.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            words = {}
        if SUMMARY not in words:
            words[SUMMARY] = summary(path)
            beside.write_text(json.dumps(words, indent=1), encoding="utf-8")
        return {"name": path.name, "made": path.stat().st_mtime, **words}


LARGEST = 8 * 1024 * 1024  # bytes of an accelerogram
TEMPLATE = "earthquake"  # the reference whose band and limits it gets
TABLES = (".txt", ".csv", ".dat", ".tsv", ".lvm", ".asc", ".ascii", ".xlsx", ".tdms", ".mat")
COMPONENTS = tuple(f"{end}{place}" for end in (".ns", ".ew", ".ud") for place in ("", 1, 2))
SUFFIXES = (".at2", ".v1", ".v1a", ".v2", ".v2a", ".v1c", ".v2c", ".raw", ".smc", ".acc", *COMPONENTS, *TABLES)


def make_reference(
    folder: Path, name: str, content: bytes, unit: str, sample_time: float, channel: int = 0
) -> Path | Proposal:
    """Store the record, write a reference that plays it, and try it; what else a table holds, and how to import it.

    Parameters
    ----------
    folder : of uploads.
    name : of the file.
    content : its bytes.
    unit, channel : as of `read_accelerogram`.
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
