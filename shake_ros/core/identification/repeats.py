"""Equal commands: where a recording, or two of them, hold the same command twice, and what a signal then repeats.

A model that the command alone drives answers equal commands alike, so what differs between two answers no such model
can have. Of two signals a and b under equal commands, each without its mean,

    repeats : mean of a b        differs : mean of (a − b)²/2        and the two add up to the mean square.

Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach (2012), 4.3, for two periods.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.analysis.multisine_split import repeated_period

Floats = NDArray[np.float64]
SHORTEST = 1.0  # stretch of an equal command that tells something [s]
ALIKE = 0.15  # change relative to the command up to which it is equal: a residual is without what the model makes of it
MOST = 30  # recordings that are compared with each other: of more, each is compared with itself alone
LEAST_OVERLAP = 0.5  # of the shorter of two recordings, below which stretches are alike by chance


@dataclass(frozen=True)
class Repeat:
    """Two stretches under the same command: of recordings `first` and `second`, which may be one and the same."""

    first: int
    second: int
    here: slice
    there: slice


def repeats(commands: Sequence[Floats], sample_times: Sequence[float]) -> list[Repeat]:
    """All pairs of stretches with equal commands: neighbouring periods of one recording, and pairs of recordings.

    Parameters
    ----------
    commands : of each recording, shape (n,). sample_times : of each [s]; only equal ones are compared.

    >>> u = np.random.default_rng(1).standard_normal(3000)
    >>> [(r.first, r.second, r.there.start) for r in repeats([u[:2000], u[500:]], [1e-3, 1e-3])]
    [(0, 1, 0)]
    """
    found = []
    for i, u in enumerate(commands):
        period = repeated_period(u, change=ALIKE)
        if period is not None and (len(u) - period) * sample_times[i] >= SHORTEST:
            first = min(max(len(u) - 2 * period, 0), period)  # a first period settles, where two follow it
            found.append(Repeat(i, i, slice(first, len(u) - period), slice(first + period, len(u))))
        for j in range(i + 1, len(commands) if len(commands) <= MOST else 0):
            pair = _overlap(u, commands[j]) if sample_times[i] == sample_times[j] else None
            if pair is not None and (pair[0].stop - pair[0].start) * sample_times[i] >= SHORTEST:
                found.append(Repeat(i, j, *pair))
    return found


def _overlap(a: Floats, b: Floats) -> tuple[slice, slice] | None:
    """The stretches of two commands that are alike once shifted to where they correlate most; None where none are."""
    size = 2 ** int(np.ceil(np.log2(len(a) + len(b))))
    product = np.fft.irfft(np.fft.rfft(a - a.mean(), size) * np.conj(np.fft.rfft(b - b.mean(), size)), size)
    lag = int(np.argmax(product))  # a[k + lag] is b[k]
    lag = lag - size if lag > size // 2 else lag
    first, second = max(lag, 0), max(-lag, 0)
    count = min(len(a) - first, len(b) - second)
    if count < LEAST_OVERLAP * min(len(a), len(b)):
        return None
    here, there = slice(first, first + count), slice(second, second + count)
    change, scale = float(np.std(a[here] - b[there])), float(np.std(a[here]))
    return (here, there) if 0.0 < scale and change < ALIKE * scale else None


def repeated_and_different(a: Floats, b: Floats) -> tuple[float, float]:
    """Mean square of what two signals share and of what differs between them [unit²]; their means do not count.

    >>> a, b = np.array([1.0, -1.0, 3.0, -3.0]), np.array([1.0, -1.0, 1.0, -1.0])
    >>> repeated_and_different(a, b)
    (2.0, 1.0)
    """
    a, b = a - np.mean(a), b - np.mean(b)
    return float(np.mean(a * b)), float(0.5 * np.mean((a - b) ** 2))
