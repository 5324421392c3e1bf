"""Rows of a laboratory's table that are missing or written twice: left out, or filled where that is asked for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from shake_ros.core.analysis.stretches import stretches
from shake_ros.data.recordings.series import broken

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
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


def bridged(values: dict[str, Floats], most: int) -> tuple[dict[str, Floats], int, int]:
    """A table whose gaps of up to `most` samples are filled, the number of samples filled and that of gaps.

    Parameters
    ----------
    values : columns of shape (n,), NaN where a cell is empty; `time` rises. Absent rows are those at which the time
        goes on by more than a period.
    """
    number = _numbers(values["time"])
    whole = np.arange(number[-1] + 1)
    there = np.zeros(len(whole), dtype=np.bool_)
    there[number] = True
    kept = there | _short(~there, most)
    filled: dict[str, Floats] = {"time": np.interp(whole, number, values["time"])[kept]}
    count, gaps = 0, np.zeros(len(whole), dtype=np.bool_)
    for name in values:
        if name == "time":
            continue
        column = np.full(len(whole), np.nan)
        column[number] = values[name]
        finite = np.isfinite(column)
        fill = _short(~finite, most)
        if finite.sum() > 3 and fill.any():
            curve = np.interp(whole, whole[finite], column[finite])
            if name not in HELD:
                curve = np.asarray(CubicSpline(whole[finite], column[finite])(whole))
            column = np.where(fill, curve, column)
            gaps |= fill
            count = int(gaps.sum())
        filled[name] = column[kept]
    return filled, count, int(np.count_nonzero(np.diff(gaps.astype(int)) == 1))


def longest_short_gap(values: dict[str, Floats], most: int) -> int:
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
