"""The part of a run in which a periodic excitation keeps its amplitude, between soft start and soft stop."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from shake_ros.core.analysis.stretches import stretches
from shake_ros.core.quantities import ShakeError

SHORTEST_BLOCK = 64  # samples whose root mean square is taken; at least one period
SAME_LEVEL = 0.02
DRIVEN = 0.5  # of the largest level: what is below is a pause or a ramp


def steady_part(time: npt.ArrayLike, excitation: npt.ArrayLike, frequency: float) -> slice:
    """The longest row of whole periods of the same amplitude, without its first block, in which the table settles.

    Parameters
    ----------
    time, excitation : (n,) [s], [any unit]; equally spaced but for jitter.
    frequency : fundamental of the excitation [Hz].

    Raises
    ------
    ShakeError
        where there is not a whole period.

    >>> t = np.arange(3000) * 0.001
    >>> steady_part(t, np.where(t < 1.0, t, 1.0) * np.sin(2 * np.pi * 5.0 * t), 5.0)
    slice(1200, 3000, None)
    """
    t, y = np.asarray(time, dtype=np.float64), np.asarray(excitation, dtype=np.float64)
    if not (frequency > 0.0 and len(t) > 1):
        raise ShakeError(f"no whole period of {frequency:g} Hz in {len(t)} samples")
    period = (len(t) - 1) / (t[-1] - t[0]) / frequency  # samples, not a whole number
    block = period * max(math.ceil(SHORTEST_BLOCK / period), 1)
    count = math.floor((len(t) + 0.5) / block)
    if count < 1:
        raise ShakeError(f"{t[-1] - t[0]:.3g} s hold no whole period of {frequency:g} Hz")
    edges = np.minimum(np.round(block * np.arange(count + 1)).astype(int), len(t))
    levels = np.array([np.std(y[i:j]) for i, j in zip(edges[:-1], edges[1:], strict=True)])
    usual = np.median(levels[levels >= DRIVEN * levels.max()])
    first, last = _longest_row(np.abs(levels - usual) <= SAME_LEVEL * usual)
    settled = first + 1 if last - first > 1 else first
    return slice(int(edges[settled]), int(edges[last]))


def _longest_row(wanted: npt.NDArray[np.bool_]) -> tuple[int, int]:
    """First and behind-the-last index of the longest row of True."""
    longest = max(stretches(wanted), key=lambda s: s.stop - s.start, default=slice(0, len(wanted)))
    return longest.start, longest.stop
