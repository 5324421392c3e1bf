"""A table that somebody else wrote (text, .xlsx, .tdms, .mat) → columns in SI units: the one reader of all of them.

`import_csv`, `--also`, two columns of an accelerogram and what a page uploads come through here.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.recordings.tables import containers
from shake_ros.recordings.tables.containers import first_bytes, read_text
from shake_ros.recordings.tables.layout import (
    BLANK,
    CLOCK,
    Dialect,
    Floats,
    clock,
    find_layout,
    is_number,
    number,
    over_midnight,
    split,
)
from shake_ros.recordings.tables.units import BRACKETS, QUANTITIES, Unit, quantity_of, unit_of

LONGEST_HEADER, FEW = 200, 12  # lines of a header, and of one heading in quotes
CHUNK = 20_000  # rows that are taken at once
VALUE = r"\d*\.?\d+(?:[eE][+-]?\d+)?|\d+\.?"
SHIFTED = re.compile(rf"\s*([+-]?(?:{VALUE}))\s*([+-]\s*(?:{VALUE}))\s*")  # scale and offset
AS_THEY_ARE = ("share", "voltage", "current", "force", "count")  # quantities that may be a command without a scale


@dataclass(frozen=True)
class Column:
    """A column by name or by number from 1, with the factor that takes it to SI units and what is added then."""

    name: str
    scale: float | None = None  # None where the unit in the heading decides
    offset: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Column:
        """Read `COL`, `COL*scale` or `COL*scale+offset`.

        >>> Column.parse("CHANNEL0*0.01"), Column.parse("x [mm]")
        (Column(name='CHANNEL0', scale=0.01, offset=0.0), Column(name='x [mm]', scale=None, offset=0.0))
        >>> Column.parse("mA*0.125-1.5").offset
        -1.5
        """
        name, star, factor = text.rpartition("*")
        if not star:
            return cls(text.strip())
        shifted = SHIFTED.fullmatch(factor)
        try:
            scale = float(shifted[1] if shifted else factor)
        except ValueError:
            return cls(text.strip())
        if not np.isfinite(scale) or scale == 0.0:
            raise ShakeError(f"column '{text}': the scale must be a finite number other than 0")
        return cls(name.strip(), scale, float(shifted[2].replace(" ", "")) if shifted else 0.0)


class Converted(NamedTuple):
    """A column in SI units, its unit as found, and what was assumed of it, empty where nothing was."""

    values: Floats
    unit: str
    note: str


@dataclass(frozen=True)
class ColumnTable:
    """Columns with names and units."""

    path: Path  # the file
    # names, units: of the columns; units are those of a row or attribute of their own, empty where there are none
    names: tuple[str, ...]
    units: tuple[str, ...]
    # gives the values of the columns of some indices, NaN where a cell is empty
    read: Callable[[Sequence[int]], list[Floats]]
    numbers: tuple[int, ...]  # indices of the columns that hold numbers
    header: tuple[str, ...] = ()  # lines above the table
    notes: list[str] = field(default_factory=list)  # what was left out, a line each; more may come with what is read
    line: Callable[[int], str] = lambda row: f"row {row + 1}"  # of the file in which row `i` stands, for messages

    def place(self, name: str) -> int:
        """Index of a column: its name, its name in another case or without its unit, or its number from 1.

        Raises
        ------
        ShakeError : there is none or there are several of that name.
        """
        for simple in (str, _folded, _bare):
            places = [i for i, known in enumerate(self.names) if simple(known) == simple(name)]
            if len(places) > 1 and name:
                raise ShakeError(f"{self.path}: column '{name}' occurs {len(places)} times; give its number")
            if places and name:
                return places[0]
        width = max(len(self.names), *(i + 1 for i in self.numbers))
        if name.isdecimal():
            if not 1 <= int(name) <= width:
                raise ShakeError(f"{self.path}: no column {name}, the table has {width} columns")
            return int(name) - 1
        if not any(self.names):
            raise ShakeError(
                f"{self.path}: no line of names above the numbers; give column '{name}' by its number from 1"
            )
        raise unknown_name("column", name, (known for known in self.names if known), str(self.path))

    def name(self, place: int) -> str:
        """The name of a column, or its number from 1."""
        return (self.names[place] if place < len(self.names) else "") or str(place + 1)

    def unit(self, place: int) -> Unit | None:
        """The unit of a column; None where none is named or known."""
        row = self.units[place] if place < len(self.units) else ""
        return unit_of(self.names[place] if place < len(self.names) else "", row)

    def quantity(self, place: int) -> str:
        """The quantity of a column, of QUANTITIES or as its name says; empty where neither unit nor name does."""
        unit, name = self.unit(place), quantity_of(self.name(place))
        known = unit is not None and unit.quantity in QUANTITIES and (unit.certain or unit.quantity == name)
        return unit.quantity if unit and known else name

    def signals(self, columns: dict[str, Column], wanted: dict[str, str]) -> dict[str, Converted]:
        """Some columns in SI units.

        Parameters
        ----------
        columns : by the key of the result.
        wanted : quantity of each, of QUANTITIES, or "command".

        Raises
        ------
        ShakeError : no such column, a cell that is no number, or a unit of another quantity, in one line.
        """
        places = {key: self.place(column.name) for key, column in columns.items()}
        factors = {key: self._factor(columns[key], places[key], wanted[key]) for key in columns}
        read = self.read(list(places.values()))
        return {
            key: Converted(values * factors[key][0] + columns[key].offset, *factors[key][1:])
            for key, values in zip(columns, read, strict=True)
        }

    def _factor(self, column: Column, place: int, wanted: str) -> tuple[float, str, str]:
        """Factor to SI units, the unit as found, and what was assumed."""
        unit, name = self.unit(place), self.name(place)
        where = f"column '{name}'"
        if column.scale is not None:
            note = ""
            if unit and unit.certain and unit.quantity == wanted and not _near(abs(column.scale), unit.factor):
                note = f"{where} is in {unit.text}; the scale {column.scale:g} is taken, not {unit.factor:g}"
            return column.scale, unit.text if unit else "", note
        fits = unit is not None and unit.quantity == wanted
        if unit and (fits or (wanted == "command" and unit.quantity in AS_THEY_ARE)):
            share = unit.quantity == "share" or fits
            note = "" if share else f"{where} is in {unit.text} and taken as it is: a scale takes a command to −1 … 1"
            return unit.factor if share else 1.0, unit.text, note
        if unit and unit.certain:
            article = "an" if wanted[0] in "aeiou" else "a"
            what = unit.quantity if unit.quantity in QUANTITIES else "something else"
            raise ShakeError(
                f"{self.path}: column '{name}' is in {unit.text}, {what}, where {article} {wanted} is wanted; "
                f"give a scale, as in '{name}*1.0', if that is meant"
            )
        if wanted == "command":
            return 1.0, "", ""
        row = self.units[place].strip() if place < len(self.units) else ""
        inside = row or next((text for text in re.findall(r"\[([^\]]+)\]", name) if not text.isdecimal()), "")
        if inside and not unit:
            raise ShakeError(f"{self.path}: column '{name}': the unit '{inside}' is not known; give a scale")
        return 1.0, "", f"{where} names no unit: taken as {QUANTITIES[wanted].replace('**2', '²')}"


def _near(a: float, b: float) -> bool:
    return abs(a - b) <= 2e-3 * b


def _folded(name: str) -> str:
    return unicodedata.normalize("NFKC", name).casefold().strip()


def _bare(name: str) -> str:
    return re.split(r"[,;:/]", BRACKETS.sub("", _folded(name)))[0].strip(" _")


def read_table(path: Path | str, skip: int | None = None, decimal: str = "") -> ColumnTable:
    """Read a table.

    Parameters
    ----------
    path : text, .xlsx, .tdms, or .mat.
    skip : lines above the table that are not looked at; None: what is above is found.
    decimal : point or comma, if the numbers do not decide it.

    Raises
    ------
    ShakeError : one line with the file, and line, column and content where they are to blame.
    """
    path = Path(path)
    if containers.is_workbook(first_bytes(path)):
        return _of_workbook(path)
    if reader := containers.reader_of(path, first_bytes(path)):
        names, units, columns = reader(path)
        return ColumnTable(path, names, units, lambda places: [columns(i) for i in places], tuple(range(len(names))))
    return table_of(path, read_text(path).split("\n"), skip, decimal)


def _of_workbook(path: Path) -> ColumnTable:
    """The first sheet of an Excel workbook that holds rows of numbers."""
    refused = ShakeError(f"{path}: no rows of numbers found")
    for lines in containers.sheets(path):
        try:
            table = table_of(path, lines, decimal=".")
        except ShakeError as error:
            refused = error
            continue
        width = max(i + 1 for i in table.numbers)
        names = tuple(table.name(i) for i in range(width))
        return ColumnTable(path, names, table.units, table.read, tuple(range(width)))
    raise refused


def _joined(lines: Sequence[str]) -> list[str]:
    """Lines in which a heading in quotes that goes over several is one, and blank ones follow."""
    found = list(lines)
    for i in range(min(len(found), LONGEST_HEADER)):
        end = i
        while found[i].count('"') % 2 and end < min(i + FEW, len(found) - 1):
            end += 1
            found[i] += f" {found[end]}"
        if end > i and not found[i].count('"') % 2:
            found[i + 1 : end + 1] = [""] * (end - i)
        elif end > i:
            found[i] = lines[i]
    return found


def table_of(path: Path, lines: Sequence[str], skip: int | None = None, decimal: str = "") -> ColumnTable:
    """The table in the lines of a text; parameters and errors as of `read_table`."""
    lines = _joined(lines)
    try:
        layout = find_layout(lines, skip or 0, decimal)
    except ShakeError as error:
        raise ShakeError(f"{path}: {error}") from None
    rows = _Rows(path, lines, layout, list(layout.notes))
    return ColumnTable(
        path, layout.names, layout.units, rows.read, layout.numbers, layout.header, rows.notes, rows.line_of
    )


@dataclass(frozen=True)
class _Rows:
    """The rows of a text."""

    path: Path
    lines: Sequence[str]
    layout: Dialect
    notes: list[str]

    def read(self, places: Sequence[int]) -> list[Floats]:
        """The values of some columns."""
        parts: list[list[Floats]] = [[] for _ in places]
        clocks = self._clocks(places)
        for start, stop in self.layout.rows:
            for first in range(start, stop, CHUNK):
                chunk = self.lines[first : min(first + CHUNK, stop)]
                taken = None if any(clocks) else self._fast(chunk, places)
                for part, values in zip(parts, taken or self._careful(chunk, first, places, clocks), strict=True):
                    part.append(values)
        columns = [np.concatenate(part) for part in parts]
        return [over_midnight(c) if is_clock else c for c, is_clock in zip(columns, clocks, strict=True)]

    def line_of(self, row: int) -> str:
        """Where a row stands, for a message."""
        kept = (i for start, stop in self.layout.rows for i in range(start, stop) if self._cells(i))
        return f"line {next((i for n, i in enumerate(kept) if n == row), -1) + 1}"

    def _cells(self, index: int) -> list[str]:
        """The cells of a line, none where it is no row."""
        line = self.lines[index]
        if not line.strip() or line.lstrip().startswith(("#", "%", "//")):
            return []
        found = split(line, self.layout.separator)
        if len([cell for cell in found if cell]) == 1 and not any(map(is_number, found)):
            note = f"line {index + 1}: '{line.strip()[:40]}' is not a row; left out"
            if self.layout.width > 1 and note not in self.notes:
                self.notes.append(note)
            return [] if self.layout.width > 1 else found
        while len(found) > self.layout.width and not found[-1]:
            found.pop()
        return found

    def _clocks(self, places: Sequence[int]) -> list[bool]:
        """Which columns hold times of day."""
        first = next(found for i in range(*self.layout.rows[0]) if (found := self._cells(i)))
        return [place < len(first) and bool(CLOCK.fullmatch(first[place])) for place in places]

    def _fast(self, chunk: Sequence[str], places: Sequence[int]) -> list[Floats] | None:
        """Values of rows that hold nothing but plain numbers; None where some row holds anything else."""
        separator, width, blank = self.layout.separator, self.layout.width, self.layout.separator == BLANK
        rows = [line for line in chunk if line.strip()]
        if self.layout.decimal == "," and separator != ",":
            if any("." in line or '"' in line for line in rows):
                return None
            rows = [line.replace(",", ".") for line in rows]
        counts = {len(line.split()) if blank else line.count(separator) + 1 for line in rows}
        empty = separator * (max(counts, default=0) - width)
        if len(counts) != 1 or max(counts) < width or not all(line.endswith(empty) for line in rows):
            return None
        try:
            found = np.loadtxt(
                rows, delimiter=None if blank else separator, comments=None, quotechar='"', usecols=places, ndmin=2
            )
        except ValueError:
            return None
        return list(found.T)

    def _careful(self, chunk: Sequence[str], first: int, places: Sequence[int], clocks: Sequence[bool]) -> list[Floats]:
        """Values of rows with anything in them; a ShakeError where a row is short, long, or holds no number."""
        values: list[list[float]] = [[] for _ in places]
        needed = max(places) + 1
        for index in range(first, first + len(chunk)):
            row = self._cells(index)
            if not row:
                continue
            where = f"{self.path}: line {index + 1}"
            if len(row) < needed:
                raise ShakeError(f"{where} has {len(row)} columns, {needed} are needed")
            if any(map(is_number, row[self.layout.width :])):
                raise ShakeError(f"{where} has {len(row)} columns where {self.layout.width} should be")
            for column, place, is_clock in zip(values, places, clocks, strict=True):
                try:
                    column.append(clock(row[place]) if is_clock else number(row[place], self.layout.decimal))
                except ValueError:
                    name = (self.layout.names[place : place + 1] or ("",))[0] or place + 1
                    raise ShakeError(f"{where}, column '{name}' holds '{row[place][:40]}', not a number") from None
        return [np.array(column, dtype=np.float64) for column in values]
