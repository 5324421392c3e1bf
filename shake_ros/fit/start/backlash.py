"""Backlash as the acceleration shows it without a model: whether there is any, and about how wide it is.

Nothing pushes the table while the rod crosses the gap, so the acceleration dwells at zero each time that the force
changes sign in motion, and leaves at once when the rod strikes. Without backlash it passes through zero about as fast
as it has approached: the time within a band about zero is that from three times the band to it. Where a soft zone or
friction keeps it there, it leaves no faster than it came. A table at rest may stick and is left out. A steady force
moves the dwells away from zero and hides them, as does noise of their size.

During a dwell the table keeps its velocity and the rod follows the valve, so the gap is about the integral of the
difference; it comes out too small where a dwell is noticed late.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from shake_ros.fit.records import Record
from shake_ros.fit.start.linear_table import slow_gain

BACKLASH = "coupling_backlash"
NOISE, SIZE = 4.0, 0.01  # half width of the band: standard deviations of the noise, or parts of the acceleration's
AT_REST = 0.1  # of the velocity's standard deviation, below which a table may stick
LONG = 3.0  # times what the way to the band has taken, from which it is a dwell
FEWEST = 5  # dwells at least
SHARE = 0.05  # of the changes of sign, from which they show backlash: without it at most 0.021 dwell, on 81 tables


def share_of_dwells(records: Sequence[Record]) -> float:
    """Part of the acceleration's changes of sign in motion that dwells at zero [-]; 0 of too few dwells."""
    long = np.concatenate([np.zeros(0), *(dwells(r) for r in records if r.acceleration is not None)]) > LONG
    return float(np.mean(long)) if np.sum(long) >= FEWEST else 0.0


def shows_backlash(records: Sequence[Record]) -> bool:
    """Whether the acceleration dwells at zero so often that there is a gap."""
    return share_of_dwells(records) > SHARE


def dwells(record: Record) -> np.ndarray:
    """Time within the band over that of the way to it, of each change of the acceleration's sign in motion, shape (m,).

    0 where the way from the band takes longer than that to it: nothing strikes there.

    >>> from types import SimpleNamespace
    >>> time = np.arange(3000) * 1e-3
    >>> a, v = np.sin(9.0 * time), 1.0 + 0.5 * np.sin(time)
    >>> def of(a):
    ...     return SimpleNamespace(start=0, acceleration=a, velocity=v, acceleration_noise=lambda: 0.01)
    >>> bool(np.median(dwells(of(a))) < 1.5), bool(np.median(dwells(of(np.where(abs(a) < 0.3, 0.0, a)))) > 3.0)
    (True, True)
    """
    return _changes_of_sign(record).ratios


def width_of_gap(records: Sequence[Record]) -> float:
    """Width of the gap [m], within about a factor of two: the upper quartile over the dwells; 0 without a dwell."""
    found = []
    for record in (r for r in records if r.acceleration is not None):
        each = _changes_of_sign(record)
        last, first, long = each.last, each.first, each.ratios > LONG
        u = slow_gain([record]) * record.commands[record.start :]
        relative = np.concatenate([[0.0], np.cumsum(u - record.velocity[record.start :])])
        at_first = (relative[last + 1] - relative[last]) * (first - last)  # the two move together where it begins
        crossed = (relative[first] - relative[last] - at_first) * record.sample_time
        found.append(np.abs(crossed[long]))
    widths = np.concatenate([np.zeros(0), *found])
    return float(np.quantile(widths, 0.75)) if len(widths) else 0.0


class SignChanges(NamedTuple):
    """Changes of the acceleration's sign that count, arrays of shape (m,).

    last, first : sample before the band, and beyond it. before : samples of the way to it. struck : whether the way
    from it takes no longer.
    """

    last: np.ndarray
    first: np.ndarray
    before: np.ndarray
    struck: np.ndarray

    @property
    def ratios(self) -> np.ndarray:
        """As of `dwells`."""
        return np.where(self.struck, (self.first - self.last) / self.before, 0.0)


def _changes_of_sign(record: Record) -> SignChanges:
    """Those of one record."""
    assert record.acceleration is not None
    a, v = record.acceleration[record.start :], record.velocity[record.start :]
    band = max(NOISE * record.acceleration_noise(), SIZE * float(np.std(a)))
    places = np.arange(len(a))
    far = np.abs(a) > 3.0 * band
    beyond = np.maximum.accumulate(np.where(far, places, -1))
    again = np.minimum.accumulate(np.where(far, places, len(a))[::-1])[::-1]
    resting = np.concatenate([[0], np.cumsum(np.abs(v) < AT_REST * np.std(v))])
    outside = np.flatnonzero(np.abs(a) > band)
    changes = np.flatnonzero(np.diff(np.sign(a[outside])))
    last, first = outside[changes], outside[changes + 1]
    began = np.concatenate([[0], first[:-1]])  # when it came to this side
    counts = (beyond[last] >= began[: len(last)]) & (resting[first + 1] == resting[last])
    before = np.maximum(last - beyond[last], 1)
    struck = again[first] - first < before
    return SignChanges(last[counts], first[counts], before[counts], struck[counts])
