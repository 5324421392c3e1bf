"""Tests of a residual (chapter 4): is it white, and independent of the input?

A model that lacks nothing leaves a residual that no past and no input predicts. Both tests look at ±25 lags and decide
at 99 %: whiteness by the portmanteau statistic of Ljung and Box, independence by the quadratic form of the
cross-correlations with their covariance under independence. Sources: L. Ljung, System Identification (1999), 16.6;
G. Ljung, G. Box, Biometrika 65 (1978).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz
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
