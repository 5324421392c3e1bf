"""What of a residual the command still predicts: by coherence, and by a filter that looks ahead, on validation data.

    ê(t) = Σ_f Σ_k h_f(k) f(u(t − k T)),   k from − AHEAD to BEHIND,   f(u) = u, |u| u, |u|, sign u

fitted by ridge on other recordings. Its taps are those of a slow rate T, so that they are few beside the samples; what
lies above that rate's band it cannot take. Of the recordings that it has not seen it takes only what is there: a
residual that no command tells makes it worse than nothing, and counts as nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, coherence, sosfiltfilt, welch

Floats = NDArray[np.float64]
RATE = 125.0  # of the taps [Hz]: the oil column and its second harmonic
BAND = 0.4  # of that rate, to which signals are filtered first
AHEAD, BEHIND = 0.05, 0.4  # reach of the taps [s]: the oil column has rung out
RIDGES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)  # on a tap, of the mean power of all
FOLDS = 4  # parts of the recordings, each left out once to choose among them
FEWEST = 3.0  # samples for each tap; with fewer no filter is fitted
BLOCK = 0.5  # length of a block by whose scatter a gain is judged [s]
BEYOND = 3.0  # standard errors from which a gain is one
SEGMENT = 1.0  # length of a segment of the coherence's spectra [s]
HANN_OVERLAP = 9.0 / 11.0  # independent segments per half-overlapping Hann segment
CHANCE = 0.01  # probability by which a coherence is taken for one that is not


@dataclass(frozen=True)
class Driven:
    """A residual and the command that acted, at the rate of the taps. taps : shape (n, t). residual : shape (n,)."""

    taps: Floats
    residual: Floats
    step: float


def _functions(u: Floats) -> list[Floats]:
    return [u, np.abs(u) * u, np.abs(u), np.sign(u)]


def driven(residual: Floats, commands: Floats, start: int, sample_time: float) -> Driven:
    """Both at the rate of the taps.

    Parameters
    ----------
    residual : shape (m,). commands : of the whole recording, shape (n,) with n ≥ start + m. start : first sample of the
        residual.
    """
    stride = max(round(1.0 / (RATE * sample_time)), 1)
    step = stride * sample_time

    def slow(signal: Floats) -> Floats:
        if stride > 1:
            signal = sosfiltfilt(butter(4, 2.0 * BAND / stride, output="sos"), signal)
        return np.asarray(signal)

    at = np.arange(start, start + len(residual), stride)
    ahead, behind = round(AHEAD / step), round(BEHIND / step)
    shifts = stride * np.arange(-ahead, behind + 1)
    columns = []
    for values in _functions(commands):
        padded = np.pad(slow(values), (behind * stride, ahead * stride), mode="edge")
        index = at[:, None] + behind * stride - shifts[None, :]
        columns.append(padded[np.minimum(index, len(padded) - 1)])
    return Driven(np.concatenate(columns, axis=1), slow(residual)[::stride], step)


def _normal(parts: Sequence[Driven], centre: Floats, scale: Floats) -> tuple[Floats, Floats]:
    size = len(centre)
    matrix, right = np.zeros((size, size)), np.zeros(size)
    for part in parts:
        rows = (part.taps - centre) / scale
        matrix += rows.T @ rows
        right += rows.T @ (part.residual - part.residual.mean())
    return matrix, right


def _folds(parts: Sequence[Driven]) -> list[list[Driven]]:
    """The same data in FOLDS stretches of time of each recording."""
    folds: list[list[Driven]] = [[] for _ in range(FOLDS)]
    for part in parts:
        for k, index in enumerate(np.array_split(np.arange(len(part.residual)), FOLDS)):
            folds[k].append(Driven(part.taps[index], part.residual[index], part.step))
    return folds


def _solved(matrix: Floats, right: Floats) -> Floats:
    return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)


@dataclass(frozen=True)
class CommandFilter:
    """A fitted filter: ê = ((taps − centre)/scale) weights."""

    centre: Floats
    scale: Floats
    weights: Floats

    def left(self, part: Driven) -> Floats:
        """What it leaves of a residual."""
        rest = part.residual - part.residual.mean() - ((part.taps - self.centre) / self.scale) @ self.weights
        return np.asarray(rest - rest.mean())


def fitted_filter(parts: Sequence[Driven]) -> CommandFilter | None:
    """The filter of several recordings, its ridge chosen on folds of them; None where they are too few samples."""
    if not parts or sum(len(p.residual) for p in parts) < FEWEST * parts[0].taps.shape[1]:
        return None
    rows = np.concatenate([p.taps for p in parts])
    centre, scale = rows.mean(axis=0), np.maximum(rows.std(axis=0), 1e-12)
    folds = _folds(parts)
    normals = [_normal(fold, centre, scale) for fold in folds]
    matrix, right = (np.sum(each, axis=0) for each in zip(*normals, strict=True))
    unit = np.eye(len(centre)) * float(np.trace(np.asarray(matrix))) / len(centre)
    costs = []
    for ridge in RIDGES:
        cost = 0.0
        for fold, (own, found) in zip(folds, normals, strict=True):
            tried = CommandFilter(centre, scale, _solved(matrix - own + ridge * unit, right - found))
            cost += sum(float(np.sum(tried.left(part) ** 2)) for part in fold)
        costs.append(cost)
    best = RIDGES[int(np.argmin(costs))]
    return CommandFilter(centre, scale, _solved(matrix + best * unit, right))


def taken(fitted: CommandFilter, part: Driven) -> float:
    """Mean square that a filter takes of a residual it has not seen [unit²]; nothing where that may be chance."""
    before = (part.residual - part.residual.mean()) ** 2
    gain = before - fitted.left(part) ** 2
    length = max(round(BLOCK / part.step), 1)
    blocks = [float(np.mean(b)) for b in np.array_split(gain, max(len(gain) // length, 1))]
    mean = float(np.mean(gain))
    if len(blocks) < 3 or mean <= BEYOND * float(np.std(blocks, ddof=1)) / len(blocks) ** 0.5:
        return 0.0
    return mean


def coherent_mean_square(residual: Floats, command: Floats, sample_time: float) -> float:
    """Mean square of what a linear filter of the command explains, less what chance explains [unit²].

    It is that of the best linear approximation: what an odd nonlinearity has of it counts. Both of shape (n,).
    """
    e, u = residual - np.mean(residual), command - np.mean(command)
    rate = 1.0 / sample_time
    length = min(round(SEGMENT * rate), len(e) // 8)
    if length < 4 or not np.any(u) or not np.any(e):
        return 0.0
    segments = (2 * len(e) // length - 1) * HANN_OVERLAP
    frequency, power = welch(e, rate, nperseg=length)
    _, together = coherence(e, u, rate, nperseg=length)
    together = np.nan_to_num(together)
    driven = welch(u, rate, nperseg=length)[1]
    together = np.where(driven > 1e-8 * driven.max(), together, 0.0)
    above_chance = np.maximum((segments * together - 1.0) / max(segments - 1.0, 1.0), 0.0)
    significant = together > 1.0 - CHANCE ** (1.0 / max(segments - 1.0, 1.0))
    return float(np.sum(np.where(significant, above_chance, 0.0) * power) * (frequency[1] - frequency[0]))
