"""What the columns of a table could be: names, units, ranges, the rate, and the command that imports them."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shake_ros.quantities import ShakeError
from shake_ros.recordings.tables.table import ColumnTable, read_table
from shake_ros.recordings.tables.units import quantity_of

OFFERED = ("time", "command", "position", "acceleration", "force", "pressure")
KINDS = {"voltage": "command", "current": "command", "share": "command"}
ASSUMED = {"time": "s", "position": "m", "acceleration": "m/s²", "force": "N"}
LONGEST_STEP = 0.5  # of a time without a unit, from which it is taken for milliseconds or a count [s]


@dataclass(frozen=True)
class Described:
    """A column: its name, unit, least and largest value in that unit, and what it could be, empty where unknown."""

    name: str
    unit: str
    least: float
    largest: float
    could_be: str


@dataclass(frozen=True)
class Proposal:
    """What a table holds and how to import it; `str` of it is for a person."""

    path: Path  # the file
    columns: tuple[Described, ...]  # those that hold numbers
    rows: int  # their number
    rate: float | None  # of the samples, from the column of the time [Hz]; None where there is none
    arguments: tuple[str, ...]  # of `import_csv`, with a word in capitals for what the user has to choose
    notes: tuple[str, ...]  # what was left out of the file

    @property
    def command(self) -> str:
        """The command to run."""
        return " ".join(["./shake import_csv", *(shlex.quote(word) for word in self.arguments)])

    def __str__(self) -> str:
        width = max(6, *(len(c.name) for c in self.columns)) + 2
        rate = f", {self.rate:.6g} Hz" if self.rate else ", no column of time found"
        lines = [f"{self.path}: {self.rows} rows, {len(self.columns)} columns of numbers{rate}"]
        lines.append(f"  {'column':<{width}}{'unit':<10}{'least':>12}{'largest':>12}  could be")
        for c in self.columns:
            lines.append(
                f"  {c.name:<{width}}{c.unit or '–':<10}{c.least:>12.5g}{c.largest:>12.5g}  {c.could_be or '?'}"
            )
        bare = [c for c in self.columns if c.name in self.arguments and not c.unit and c.could_be in ASSUMED]
        said = [f"{c.name} names no unit: taken as {ASSUMED[c.could_be]}, '{c.name}*FACTOR' is another" for c in bare]
        return "\n".join(
            [*lines, *(f"  {note}" for note in (*self.notes, *said)), "To import it:", f"  {self.command}"]
        )


def propose(path: Path | str, skip: int | None = None, decimal: str = "") -> Proposal:
    """What the columns of a table could be.

    Parameters
    ----------
    path, skip, decimal : as of `read_table`.

    Raises
    ------
    ShakeError : no table can be read.
    """
    table = read_table(path, skip, decimal)
    places = []
    values = []
    for place in table.numbers:
        try:
            values += table.read([place])
            places.append(place)
        except ShakeError:  # a variable of a .mat file that is no column
            continue
    if not places:
        raise ShakeError(f"{path}: no column of numbers")
    kinds = [_kind(table, place, column) for place, column in zip(places, values, strict=True)]
    described = []
    for place, column, kind in zip(places, values, kinds, strict=True):
        unit, finite = table.unit(place), column[np.isfinite(column)]
        least, largest = (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)
        described.append(Described(table.name(place), unit.text if unit else "", least, largest, kind))
    rate, arguments = _arguments(table, places, values, kinds)
    return Proposal(Path(path), tuple(described), len(values[0]), rate, arguments, tuple(table.notes))


def _kind(table: ColumnTable, place: int, values: np.ndarray) -> str:
    """What a column could be, by its unit, its name, or because it rises evenly."""
    kind, name = table.quantity(place), quantity_of(table.name(place))
    if kind:
        return name if kind in KINDS and name in OFFERED else KINDS.get(kind, kind)
    steps = np.diff(values)
    even = len(steps) > 1 and bool(np.all(steps > 0.0)) and float(np.ptp(steps)) < 0.01 * float(np.median(steps))
    return "time" if even and not any(table.names) else ""


def _arguments(
    table: ColumnTable, places: list[int], values: list[np.ndarray], kinds: list[str]
) -> tuple[float | None, tuple[str, ...]]:
    """Sampling rate and arguments of `import_csv`."""
    chosen = {kind: i for i, kind in reversed(list(enumerate(kinds))) if kind in OFFERED}
    rate, words = None, [str(table.path)]
    if "time" in chosen:
        at = chosen["time"]
        unit = table.unit(places[at])
        step = float(np.median(np.diff(values[at]))) * (unit.factor if unit else 1.0) if len(values[at]) > 1 else 0.0
        unsure = unit is None and step >= LONGEST_STEP
        rate = 1.0 / step if step > 0.0 and not unsure else None
        words += ["--time", _text(table, places[at]) + ("*SECONDS" if unsure else "")]
    else:
        words += ["--rate", "HZ"]
    for kind in ("command", "position"):
        if kind == "command" or kind in chosen or "acceleration" not in chosen:
            words += [f"--{kind}", _text(table, places[chosen[kind]]) if kind in chosen else "COLUMN"]
    for kind in ("acceleration", "force"):
        words += [f"--{kind}", _text(table, places[chosen[kind]])] if kind in chosen else []
    return rate, (*words, "--out", table.path.stem)


def _text(table: ColumnTable, place: int) -> str:
    """How a column is named in an argument: by its number where its name is not there once."""
    name = table.name(place)
    return name if name and table.names.count(name) == 1 else str(place + 1)
