"""What experiments of the thesis share: its inputs, free runs under them, and what an experiment gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import run
from shake_ros.report.chart import Chart
from shake_ros.settings import find, read_yaml


class Claim(NamedTuple):
    """A statement of the thesis beside what is found here; `holds` is None where it cannot be decided."""

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
        return "cannot be decided" if self.holds is None else "holds" if self.holds else "does not hold"


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
    title : of the page.
    lead : in a sentence.
    claims : of the thesis.
    tables, charts : of this run.
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


def inputs() -> dict[str, dict[str, float]]:
    """u1, u2, … of config/reproduce/inputs.yaml."""
    content: dict[str, dict[str, float]] = read_yaml(find("reproduce", "inputs"))
    return content


def sine(wave: Mapping[str, Any], seconds: float, sample_time: float) -> np.ndarray:
    """amplitude · sin(2π frequency t), shape (n,) [-].

    >>> sine({"amplitude": 0.5, "frequency": 1.0}, 1.0, 0.25).round(6).tolist()
    [0.0, 0.5, 0.0, -0.5]
    """
    time = np.arange(round(seconds / sample_time)) * sample_time
    return np.asarray(wave["amplitude"] * np.sin(2.0 * np.pi * wave["frequency"] * time))


def recorded(name: str, table: TableParameters, commands: np.ndarray, sample_time: float) -> Record:
    """Position and acceleration of a table's free run from mid-stroke, without noise."""
    out = run(table, commands, sample_time)
    return Record(name, sample_time, commands, out[:, 0], out[:, 2])


def words(wave: Mapping[str, Any]) -> str:
    """An input in the thesis's notation.

    >>> words({"amplitude": 0.5, "frequency": 3.0})
    '0.5 sin(2π·3t)'
    """
    return f"{wave['amplitude']:g} sin(2π·{wave['frequency']:g}t)"
