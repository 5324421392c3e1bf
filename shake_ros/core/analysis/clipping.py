"""Signals that stand at an extreme value because a sensor or a converter ends there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FLAT_RUN = 3  # neighbours at the extreme value, at least once
FLAT_SHARE = 0.005  # of all samples that stand there, above which it is no chance


def standing_at(values: NDArray[np.float64], extreme: float) -> NDArray[np.bool_]:
    """Samples at an extreme value that a signal is clipped to, shape (n,); none where it only passes through.

    >>> wave = np.sin(np.arange(400) / 20.0)
    >>> int(standing_at(np.clip(wave, -2.0, 0.5), 0.5).sum()), int(standing_at(wave, wave.max()).sum())
    (138, 0)
    """
    at = np.asarray(values == extreme)
    runs = at.copy()
    for _ in range(FLAT_RUN - 1):  # keep a sample where FLAT_RUN neighbours stand at the extreme
        runs = runs[:-1] & runs[1:]
    return at if runs.any() and at.mean() > FLAT_SHARE else np.zeros(len(values), dtype=np.bool_)


def clipped(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Samples that a signal is clipped at, from below or above, shape (n,); none of a constant one."""
    low, high = float(np.min(values)), float(np.max(values))
    if low == high:
        return np.zeros(len(values), dtype=np.bool_)
    return standing_at(values, low) | standing_at(values, high)


def restored(values: NDArray[np.float64], at: NDArray[np.bool_], like: NDArray[np.float64]) -> NDArray[np.float64]:
    """A signal whose clipped samples follow another one of the same shape, no nearer to zero than where it is clipped.

    Parameters
    ----------
    values : shape (n,). at : samples at which they are clipped. like : the same quantity, to gain and offset, from
        another sensor; coarser, but not clipped.
    """
    if not at.any():
        return values
    gain, offset = np.polyfit(like[~at], values[~at], 1)
    foreseen, middle = gain * like + offset, float(np.mean(values[~at]))
    beyond = np.where(values > middle, np.maximum(values, foreseen), np.minimum(values, foreseen))
    return np.asarray(np.where(at, beyond, values))
