"""What predicts a residual: tests for whiteness and independence of the input, and what the command tells of it.

Tests (chapter 4): is it white, and independent of the input? A model that lacks nothing leaves a residual that no past
and no input predicts. Both tests look at ±25 lags and decide at 99 %: whiteness by the portmanteau statistic of Ljung
and Box, independence by the quadratic form of the cross-correlations with their covariance under independence.
Sources: L. Ljung, System Identification (1999), 16.6; G. Ljung, G. Box, Biometrika 65 (1978).

What the command predicts: by coherence, and by a filter that looks ahead, on validation data.

    ê(t) = Σ_f Σ_k h_f(k) f(u(t − k T)),   k from − AHEAD to BEHIND,   f(u) = u, |u| u, |u|, sign u

fitted by ridge on other recordings. Its taps are those of a slow rate T, so that they are few beside the samples; what
lies above that rate's band it cannot take. Of the recordings that it has not seen it takes only what is there: a
residual that no command tells makes it worse than nothing, and counts as nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz
from scipy.signal import butter, coherence, sosfiltfilt, welch
from scipy.stats import chi2, norm

from shake_ros.quantities import ShakeError

Floats = NDArray[np.float64]
LAGS = 25
LEVEL = 0.99


@dataclass(frozen=True)
class ResidualTest:
    """Correlations of a residual with its past and with an input.

    Attributes
    ----------
    autocorrelation : lags 0 … LAGS, shape (LAGS + 1,). cross_correlation : lags −LAGS … LAGS, shape (2 LAGS + 1,);
        positive lags: the residual follows the input.
    auto_bound, cross_bound : of a single lag at 99 %.
    auto_p, cross_p : probability of as much by chance, all lags together.
    """

    autocorrelation: Floats
    cross_correlation: Floats
    auto_bound: float
    cross_bound: float
    auto_p: float
    cross_p: float

    @property
    def white(self) -> bool:
        """Whether whiteness stands at 99 %."""
        return self.auto_p > 1.0 - LEVEL

    @property
    def independent(self) -> bool:
        """Whether independence from the input stands at 99 %."""
        return self.cross_p > 1.0 - LEVEL


def _series(residual: ArrayLike, excitation: ArrayLike, shortest: int) -> tuple[Floats, Floats]:
    """Both as arrays without their means; refuses other lengths, too few samples and what is not finite."""
    e, u = np.asarray(residual, dtype=np.float64), np.asarray(excitation, dtype=np.float64)
    if e.shape != u.shape or e.ndim != 1 or len(e) < shortest:
        raise ShakeError(f"residual {e.shape} and input {u.shape} must be alike and of at least {shortest} samples")
    if not (np.isfinite(e).all() and np.isfinite(u).all()):
        raise ShakeError("the residual or the input holds a value that is not finite")
    return e - e.mean(), u - u.mean()


def covariances(a: Floats, b: Floats, lags: int) -> Floats:
    """Mean of a(t + k) b(t) for k = −lags … lags over a record of n samples, shape (2 lags + 1,).

    >>> covariances(np.array([0.0, 1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]), 1).tolist()
    [0.0, 0.0, 0.25]
    """
    n = len(a)
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    product = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size) / n
    return np.concatenate((product[-lags:], product[: lags + 1])) if lags else product[:1]


def residual_test(residual: ArrayLike, excitation: ArrayLike, lags: int = LAGS) -> ResidualTest:
    """Test one record's residual.

    Parameters
    ----------
    residual : measured minus simulated, of a channel whose noise is white (acceleration), shape (n,).
    excitation : what drove the table, shape (n,) [-].
    """
    e, u = _series(residual, excitation, 8 * lags)
    n = len(e)
    bound = float(norm.ppf(0.5 + 0.5 * LEVEL)) / np.sqrt(n)
    e_0, u_0 = float(e @ e) / n, float(u @ u) / n
    if e_0 == 0.0 or u_0 == 0.0:
        nothing = np.zeros(2 * lags + 1)
        return ResidualTest(nothing[lags:], nothing, bound, bound, 1.0, 1.0)
    auto = covariances(e, e, lags)[lags:] / e_0
    statistic = n * (n + 2.0) * float(np.sum(auto[1:] ** 2 / (n - np.arange(1, lags + 1))))
    cross = covariances(e, u, lags) / np.sqrt(e_0 * u_0)
    together = _joint_covariance(e, u, lags) / (e_0 * u_0)
    deviation = np.sqrt(max(together[0, 0], 1.0 / n) / n)
    strength, rank = _quadratic_form(cross, together / n)
    return ResidualTest(
        auto,
        cross,
        bound,
        float(norm.ppf(0.5 + 0.5 * LEVEL)) * float(deviation),
        float(chi2.sf(statistic, lags)),
        float(chi2.sf(strength, rank)),
    )


def _joint_covariance(e: Floats, u: Floats, lags: int) -> Floats:
    """n times the covariance of the cross-covariances under independence: Σ R_e(k) R_u(k + i − j), a Toeplitz matrix.

    The sums are tapered, so that the matrix stays positive.
    """
    reach = min(len(e) // 8, 400)
    taper = 1.0 - np.arange(-reach, reach + 1) ** 2 / (reach + 1.0) ** 2
    r_e = covariances(e, e, reach) * taper
    r_u = covariances(u, u, reach + 2 * lags)
    column = [float(r_e @ r_u[2 * lags - m : 2 * lags - m + 2 * reach + 1]) for m in range(2 * lags + 1)]
    return np.asarray(toeplitz(column))


def _quadratic_form(values: Floats, covariance: Floats) -> tuple[float, int]:
    """Σ of the squares of the independent components of `values`, and the number of those that have weight."""
    weights, vectors = np.linalg.eigh(covariance)
    kept = weights > 1e-3 * weights.max()
    return float(np.sum((vectors[:, kept].T @ values) ** 2 / weights[kept])), int(kept.sum())


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
