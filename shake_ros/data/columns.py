"""A laboratory's table of columns (.csv, .txt) → arrays; separator, header and decimal comma are found."""

from __future__ import annotations

import functools
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shake_ros.core.quantities import ShakeError, unknown_name

SEPARATORS = (",", ";", "\t", None)  # None: any white space
LOOKED_AT = 200  # lines from which the layout is found
LONGEST_HEADER = 100


NUMBER = r"\d*\.?\d+(?:[eE][+-]?\d+)?|\d+\.?"
SHIFTED = re.compile(rf"\s*([+-]?(?:{NUMBER}))\s*([+-]\s*(?:{NUMBER}))\s*")  # scale and offset


@dataclass(frozen=True)
class Column:
    """A column by name or by number from 1, with the factor that takes it to SI units and what is added then."""

    name: str
    scale: float = 1.0
    offset: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Column:
        """Read `COL`, `COL*scale` or `COL*scale+offset`.

        >>> Column.parse("CHANNEL0*0.01")
        Column(name='CHANNEL0', scale=0.01, offset=0.0)
        >>> Column.parse("mA*0.125-1.5").of(12.0)
        0.0
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

    def of(self, value: float) -> float:
        """A value of the column in SI units."""
        return value * self.scale + self.offset


@dataclass(frozen=True)
class TextLayout:
    """How a table is written.

    Attributes
    ----------
    separator : between columns; None for any white space.
    first : index of the first line with numbers.
    names : of the columns, empty where there is no line of names.
    """

    separator: str | None
    first: int
    names: tuple[str, ...]

    def split(self, line: str) -> list[str]:
        """The cells of a line."""
        return [cell.strip().strip('"') for cell in line.split(self.separator)]

    def number(self, cell: str) -> float:
        """The value of a cell, NaN where it is empty; raises ValueError where it is no number."""
        if not cell:
            return float("nan")
        if self.separator != "," and "," in cell and "." not in cell:
            cell = cell.replace(",", ".")
        return float(cell)


def read_columns(
    path: Path | str, columns: dict[str, Column], skip: int | None = None
) -> dict[str, npt.NDArray[np.float64]]:
    """Read some columns of a text table.

    Parameters
    ----------
    path : the file.
    columns : what to read, by the key of the result.
    skip : lines before the numbers (or before the line of names); found by itself where None.

    Returns
    -------
    key → (n,) values in SI units; NaN where a cell is empty.

    Raises
    ------
    ShakeError
        one line with file, line number, column and content.
    """
    path = Path(path)
    head = list(_take(_lines(path), (skip or 0) + LOOKED_AT))
    layout = find_layout(path, head, skip)
    places = {key: _place(path, column, layout, head) for key, column in columns.items()}
    values = {key: array("d") for key in columns}
    needed = max(places.values())
    for number, line in enumerate(_lines(path)):
        if number < layout.first or not line.strip():
            continue
        cells = layout.split(line)
        if len(cells) <= needed:
            raise ShakeError(f"{path}: line {number + 1} has {len(cells)} columns, {needed + 1} are needed")
        for key, place in places.items():
            try:
                values[key].append(columns[key].of(layout.number(cells[place])))
            except ValueError:
                raise ShakeError(
                    f"{path}: line {number + 1}, column '{columns[key].name}' holds '{cells[place][:40]}', not a number"
                ) from None
    return {key: np.frombuffer(column, dtype=np.float64).copy() for key, column in values.items()}


def find_layout(path: Path, head: Sequence[str], skip: int | None) -> TextLayout:
    """Separator, first line of numbers and names of the columns from the first lines of a file."""
    starts = range(len(head)) if skip is None else [skip, skip + 1]
    for start in starts:
        if start >= len(head) or start > (skip or 0) + LONGEST_HEADER:
            break
        separator = max(SEPARATORS, key=functools.partial(_numbers, head, start))
        if _numbers(head, start, separator) >= 2:
            layout = TextLayout(separator, start, ())
            names = layout.split(head[start - 1]) if start else []
            if len(names) < len(layout.split(head[start])) or not any(re.search(r"[^\W\d]", name) for name in names):
                names = []
            return TextLayout(separator, start, tuple(names))
    behind = "" if skip is None else f" behind {skip} skipped lines"
    raise ShakeError(f"{path}: no rows of numbers found{behind}")


def _numbers(head: Sequence[str], start: int, separator: str | None) -> int:
    """In how many columns the line `start` and those after it hold numbers; 0 where it is no row of a table."""
    layout = TextLayout(separator, start, ())
    rows = [layout.split(line) for line in head[start : start + 5] if line.strip()]
    if not rows or not head[start].strip():
        return 0
    good = 0
    for cells in zip(*rows, strict=False):
        try:
            good += all(np.isfinite(layout.number(cell)) or not cell for cell in cells) and any(cells)
        except ValueError:
            continue
    return good


def _place(path: Path, column: Column, layout: TextLayout, head: Sequence[str]) -> int:
    """Index of a column: its exact name, its name in another case, or its number from 1."""
    names = list(layout.names)
    if column.name in names:
        if names.count(column.name) > 1:
            raise ShakeError(f"{path}: column '{column.name}' occurs {names.count(column.name)} times; give its number")
        return names.index(column.name)
    similar = [i for i, name in enumerate(names) if name.lower() == column.name.lower()]
    if len(similar) == 1:
        return similar[0]
    width = len(layout.split(head[layout.first]))
    if column.name.isdecimal():
        if not 1 <= int(column.name) <= width:
            raise ShakeError(f"{path}: no column {column.name}, the table has {width} columns")
        return int(column.name) - 1
    if not names:
        raise ShakeError(
            f"{path}: no line of names above the numbers; give column '{column.name}' by its number from 1"
        )
    raise unknown_name("column", column.name, (name for name in names if name), str(path))


def _lines(path: Path) -> Iterator[str]:
    try:
        with path.open(encoding="utf-8-sig", errors="surrogateescape", newline=None) as file:
            for line in file:
                yield line.rstrip("\n")
    except OSError as error:
        raise ShakeError(f"{path}: cannot be read ({error.strerror})") from None


def _take(lines: Iterable[str], count: int) -> Iterator[str]:
    for _, line in zip(range(count), lines, strict=False):
        yield line
