"""Rows of a laboratory's table that are missing or written twice: left out, or filled where that is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from shake_ros.core.analysis.stretches import stretches
from shake_ros.data.recordings.series import broken

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
SHORT = 3  # samples of a gap that may be filled without being asked for
HELD = ("command",)  # signals with steps, between which a straight line is drawn; a spline would swing


def without_repeats(values: dict[str, Floats]) -> tuple[dict[str, Floats], int]:
    """A table without rows that repeat the row before to the last digit, and how many these were.

    >>> without_repeats({"time": np.array([0.0, 1.0, 1.0]), "u": np.array([3.0, 4.0, 4.0])})[1]
    1
    """
    table = np.column_stack(list(values.values()))
    same = np.zeros(len(table), dtype=np.bool_)
    same[1:] = ((table[1:] == table[:-1]) | (np.isnan(table[1:]) & np.isnan(table[:-1]))).all(axis=1)
    return {name: column[~same] for name, column in values.items()}, int(same.sum())


@dataclass(frozen=True)
class Bridged:
    """A table with its short gaps filled.

    Attributes
    ----------
    values : columns of shape (n,). rows : row of the table before that each sample is, −1 where it was absent, (n,).
    filled : samples of which some value was filled, (n,).
    """

    values: dict[str, Floats]
    rows: npt.NDArray[np.int64]
    filled: Flags

    @property
    def count(self) -> int:
        """Samples filled."""
        return int(self.filled.sum())

    @property
    def gaps(self) -> int:
        """Gaps filled."""
        return len(stretches(self.filled))


def bridged(values: Mapping[str, Floats], most: int) -> Bridged:
    """A table whose gaps of up to `most` samples are filled.

    Parameters
    ----------
    values : columns of shape (n,), NaN where a cell is empty; `time` rises. Absent rows are those at which the time
        goes on by more than a period.
    """
    number = _numbers(values["time"])
    count = int(number[-1]) + 1
    rows = np.full(count, -1)
    rows[number] = np.arange(len(number))
    whole, filled = np.arange(count), np.zeros(count, dtype=np.bool_)
    found: dict[str, Floats] = {"time": np.interp(whole, number, values["time"])}
    for name in values:
        if name == "time":
            continue
        column = np.full(count, np.nan)
        column[number] = values[name]
        finite = np.isfinite(column)
        fill = _short(~finite, most)
        if finite.sum() > 3 and fill.any():
            curve = np.interp(whole, whole[finite], column[finite])
            if name not in HELD:
                curve = np.asarray(CubicSpline(whole[finite], column[finite])(whole))
            column = np.where(fill, curve, column)
            filled |= fill
        found[name] = column
    kept = (rows >= 0) | _short(rows < 0, most)
    return Bridged({name: column[kept] for name, column in found.items()}, rows[kept], filled[kept])


def longest_short_gap(values: Mapping[str, Floats], most: int) -> int:
    """Samples of the longest gap among those of up to `most` samples; 0 where there is none."""
    number = _numbers(values["time"])
    finite = np.zeros(number[-1] + 1, dtype=np.bool_)
    finite[number] = np.all([np.isfinite(column) for column in values.values()], axis=0)
    return max((n for n in range(1, most + 1) if _short(~finite, n).sum() > _short(~finite, n - 1).sum()), default=0)


def _numbers(time: Floats) -> npt.NDArray[np.int64]:
    """Number of the sample that each row is, from 0; stamps may be off by less than half a period."""
    stamps = np.rint((time - time[0]) * 1e9).astype(np.int64)
    steps = np.diff(time)
    steps = np.where(broken(stamps), np.maximum(np.rint(steps / np.median(steps)), 2.0), 1.0)
    number = np.concatenate(([0.0], np.cumsum(steps)))
    period, first = np.polyfit(number, time - time[0], 1)
    again = np.rint((time - time[0] - first) / period)  # on an even grid, where the stamps are near one
    number = again if (np.diff(again) >= 1.0).all() else number
    return (number - number[0]).astype(np.int64)


def _short(missing: Flags, most: int) -> Flags:
    """Of runs of missing samples those of up to `most` that have neighbours on both sides."""
    short = np.zeros(len(missing), dtype=np.bool_)
    for span in stretches(missing):
        if span.stop - span.start <= most and span.start > 0 and span.stop < len(missing):
            short[span] = True
    return short
