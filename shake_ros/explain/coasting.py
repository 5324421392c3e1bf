"""Whether a table coasts: the mark of a play between the piston rod and the table in the acceleration itself.

While the rod crosses the play nothing pushes the table, so its acceleration dwells at zero each time that the force on
it changes sign in motion. Otherwise the acceleration goes through zero about as fast as it has come near: the time
within a band about zero is that which it has taken from three times the band to it. A valve, the oil, friction and a
specimen shape how it comes near, and none of them holds it there. A table that sticks is at rest, which is left out.

No model is needed. A steady force moves the dwells away from zero and hides them, as does noise of their size.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.core.identification.recordings import Record

NOISE, SIZE = 4.0, 0.01  # half width of the band: standard deviations of the noise, or parts of the acceleration's
AT_REST = 0.1  # of the velocity's standard deviation, below which a table may stick
LONG = 3.0  # times what the way to the band has taken, from which it is a dwell
FEWEST = 10  # changes of sign that tell
SHARE = 0.25  # of these that dwell, from which a table coasts; without a play at most 0.1 do


def share_of_dwells(records: Sequence[Record]) -> float:
    """Part of the acceleration's changes of sign in motion that dwells at zero [-]; 0 of too few of them."""
    ratios = np.concatenate([np.zeros(0), *(dwells(r) for r in records if r.acceleration is not None)])
    return float(np.mean(ratios > LONG)) if len(ratios) >= FEWEST else 0.0


def dwells(record: Record) -> np.ndarray:
    """Time within the band over that of the way to it, of each change of the acceleration's sign in motion, shape (m,).

    >>> from types import SimpleNamespace
    >>> time = np.arange(3000) * 1e-3
    >>> a, v = np.sin(9.0 * time), 1.0 + 0.5 * np.sin(time)
    >>> def of(a):
    ...     return SimpleNamespace(start=0, acceleration=a, velocity=v, acceleration_noise=lambda: 0.01)
    >>> bool(np.median(dwells(of(a))) < 1.5), bool(np.median(dwells(of(np.where(abs(a) < 0.3, 0.0, a)))) > 3.0)
    (True, True)
    """
    assert record.acceleration is not None
    a, v = record.acceleration[record.start :], record.velocity[record.start :]
    band = max(NOISE * record.acceleration_noise(), SIZE * float(np.std(a)))
    places = np.arange(len(a))
    beyond = np.maximum.accumulate(np.where(np.abs(a) > 3.0 * band, places, -1))
    resting = np.concatenate([[0], np.cumsum(np.abs(v) < AT_REST * np.std(v))])
    outside = np.flatnonzero(np.abs(a) > band)
    changes = np.flatnonzero(np.diff(np.sign(a[outside])))
    last, first = outside[changes], outside[changes + 1]
    began = np.concatenate([[0], first[:-1]])  # when it came to this side
    counts = (beyond[last] >= began[: len(last)]) & (resting[first + 1] == resting[last])
    return np.asarray(((first - last) / np.maximum(last - beyond[last], 1))[counts])
