"""A small table of results: columns by name, aligned text in a terminal, HTML in a notebook and on a page."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

Format = Callable[[Any], str]


def plain(value: Any) -> str:
    """A cell: four digits of a number, a dash for what is not there.

    >>> plain(1234.567), plain(float("nan")), plain(True), plain(["soft_zone", "dead_volume"]), plain([])
    ('1235', '–', 'yes', 'soft_zone, dead_volume', 'nothing')
    """
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(plain, value)) or "nothing"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def percent(value: float | None) -> str:
    """A ratio in per cent, a dash where there is none.

    >>> percent(0.12345), percent(None), percent(float("nan"))
    ('12.35 %', '–', '–')
    """
    return "–" if value is None or not math.isfinite(value) else f"{100.0 * value:.2f} %"


def fixed(digits: int, sign: str = "") -> Format:
    """A format with so many decimals, a dash where there is no number.

    >>> fixed(2)(0.125), fixed(1, "+")(3.0), fixed(1)(None), fixed(1)(float("nan"))
    ('0.12', '+3.0', '–', '–')
    """
    return lambda value: "–" if value is None or not math.isfinite(value) else f"{value:{sign}.{digits}f}"


def aligned(rows: Sequence[Sequence[str]], right: Sequence[bool]) -> str:
    """Rows of text under each other, columns to the right or to the left.

    >>> print(aligned([("run", "error"), ("a", "1.5")], (False, True)))
    run  error
    a      1.5
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = (
        "  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True)) for row in rows
    )
    return "\n".join(line.rstrip() for line in lines)


class ResultTable(Mapping[str, Sequence[Any]]):
    """Rows of results under column names; a mapping from column to values, so `pandas.DataFrame(dict(frame))` works.

    Parameters
    ----------
    columns : names.
    rows : one value a column each.
    formats : how a column is shown, by name; else as `plain`.

    Examples
    --------
    >>> frame = ResultTable(("recording", "error"), [("run1", 0.25), ("run2", None)], {"error": percent})
    >>> frame
    recording    error
    run1       25.00 %
    run2             –
    >>> frame["error"]
    (0.25, None)
    >>> frame.rows[0]["recording"]
    'run1'
    """

    def __init__(
        self, columns: Sequence[str], rows: Sequence[Sequence[Any]], formats: Mapping[str, Format] | None = None
    ) -> None:
        self.columns = tuple(columns)
        self._values = tuple(map(tuple, rows))
        self.rows = tuple(dict(zip(self.columns, row, strict=True)) for row in self._values)
        self._formats = [(formats or {}).get(column, plain) for column in self.columns]

    def __getitem__(self, column: str) -> tuple[Any, ...]:
        if column not in self.columns:
            raise KeyError(column)
        return tuple(row[column] for row in self.rows)

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def cells(self) -> list[list[str]]:
        """The rows as text."""
        return [[shown(value) for shown, value in zip(self._formats, row, strict=True)] for row in self._values]

    @property
    def _numeric(self) -> list[bool]:
        """Which columns are of numbers."""
        known = [[row[k] for row in self._values if row[k] is not None] for k in range(len(self.columns))]
        return [bool(values) and all(isinstance(value, int | float) for value in values) for values in known]

    def __repr__(self) -> str:
        return aligned([self.columns, *self.cells()], self._numeric)

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(c)}</th>" for c in self.columns)
        style = [" style='text-align: right'" if right else "" for right in self._numeric]
        body = "".join(
            "<tr>" + "".join(f"<td{s}>{html.escape(c)}</td>" for c, s in zip(row, style, strict=True)) + "</tr>"
            for row in self.cells()
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
