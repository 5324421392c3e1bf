"""Parts of a signal: where something holds, where an excitation keeps its amplitude, where a sensor clips."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from shake_ros.quantities import ShakeError


def stretches(holds: NDArray[np.bool_]) -> list[slice]:
    """The stretches of true values in `holds`, shape (n,), in their order.

    >>> stretches(np.array([True, False, True, True]))
    [slice(0, 1, None), slice(2, 4, None)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], holds, [False])).astype(np.int8)))
    return [slice(first, stop) for first, stop in edges.reshape(-1, 2).tolist()]


def energies(values: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """The sum of squares of each segment of `length` samples, by its first one, shape (n − length + 1,).

    >>> energies(np.array([1.0, 2.0, 0.0, 3.0]), 2).tolist()
    [5.0, 4.0, 9.0]
    """
    total = np.concatenate(([0.0], np.cumsum(values**2)))
    return np.asarray(total[length:] - total[:-length])


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
        raise ShakeError(f"{t[-1] - t[0]:.3g} s contain no whole period of {frequency:g} Hz")
    edges = np.minimum(np.round(block * np.arange(count + 1)).astype(int), len(t))
    levels = np.array([np.std(y[i:j]) for i, j in zip(edges[:-1], edges[1:], strict=True)])
    usual = np.median(levels[levels >= DRIVEN * levels.max()])
    alike = stretches(np.abs(levels - usual) <= SAME_LEVEL * usual)
    row = max(alike, key=lambda s: s.stop - s.start, default=slice(0, len(levels)))
    settled = row.start + 1 if row.stop - row.start > 1 else row.start
    return slice(int(edges[settled]), int(edges[row.stop]))


FLAT_RUN = 3  # neighbours at the extreme value, at least once
FLAT_SHARE = 0.005  # of all samples that stand there, above which it is no chance


def held_at(values: NDArray[np.float64], extreme: float) -> NDArray[np.bool_]:
    """Samples at an extreme value that a signal is clipped to, shape (n,); none where it only passes through.

    >>> wave = np.sin(np.arange(400) / 20.0)
    >>> int(held_at(np.clip(wave, -2.0, 0.5), 0.5).sum()), int(held_at(wave, wave.max()).sum())
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
    return held_at(values, low) | held_at(values, high)


def restored(values: NDArray[np.float64], at: NDArray[np.bool_], like: NDArray[np.float64]) -> NDArray[np.float64]:
    """A signal whose clipped samples follow another one of the same shape, no nearer to zero than where it is clipped.

    Parameters
    ----------
    values : shape (n,).
    at : samples at which they are clipped.
    like : the same quantity, to gain and offset, from another sensor; coarser, but not clipped.
    """
    if not at.any():
        return values
    gain, offset = np.polyfit(like[~at], values[~at], 1)
    foreseen, middle = gain * like + offset, float(np.mean(values[~at]))
    beyond = np.where(values > middle, np.maximum(values, foreseen), np.minimum(values, foreseen))
    return np.asarray(np.where(at, beyond, values))
