"""What an experiment of the thesis gives when it is run again: claims held against it, tables, figures, remarks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from shake_ros.report.chart import Chart


class Claim(NamedTuple):
    """A statement of the thesis beside what is found here; `holds` is None where nothing can tell."""

    source: str
    statement: str
    printed: str
    found: str
    holds: bool | None
    remark: str = ""

    @property
    def verdict(self) -> str:
        """In a word.

        >>> Claim("6.3.4", "…", "–", "61 %", True).verdict
        'holds'
        """
        return "cannot be told" if self.holds is None else "holds" if self.holds else "does not hold"


class Rows(NamedTuple):
    """A table with its title."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class ExperimentReport:
    """One page of the reproduction.

    Attributes
    ----------
    title : of the page. lead : in a sentence. claims : of the thesis. tables, charts : of this run.
    remarks : what was assumed and what explains a difference.
    """

    title: str
    lead: str
    claims: Sequence[Claim]
    tables: Sequence[Rows] = ()
    charts: Sequence[Chart] = ()
    remarks: Sequence[str] = field(default=())


def difference(printed: float, found: float) -> str:
    """How far a value lies from the printed one, in per cent of that.

    >>> difference(2.0, 2.5), difference(0.0, 1.0)
    ('+25.0 %', '–')
    """
    return f"{100.0 * (found / printed - 1.0):+.1f} %" if printed else "–"
