"""Standard errors of fitted parameters, honest about residuals that are correlated in time.

The normal matrix JᵀJ of (4.10) gives the curvature; the scatter of its right-hand side Jᵀr is estimated from blocks of
time (a sandwich estimate), so filtered velocities and a small unmodelled rest do not shrink the errors. Parameters that
rest on a bound carry no standard error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.identification.fit import Fit


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter: value and standard error in its unit; None where it rests on a bound or does not act."""

    name: str
    value: float
    std_error: float | None
    unit: str


def at_bound(result: Fit) -> np.ndarray:
    """Which parameters rest on a bound, shape (p,)."""
    width = 1e-3 * np.minimum(1.0, result.free.high - result.free.low)
    return np.asarray((result.x - result.free.low < width) | (result.free.high - result.x < width))


def covariance(result: Fit, blocks: np.ndarray) -> np.ndarray:
    """Covariance of x for the parameters that are free to move, shape (p, p).

    NaN for those on a bound and for those that the residuals do not depend on.

    Parameters
    ----------
    blocks : number of the block of time that each residual belongs to, shape (n,).
    """
    inside = ~at_bound(result) & np.any(result.jacobian != 0.0, axis=0)
    j = result.jacobian[:, inside]
    inverse = np.linalg.pinv(j.T @ j, rcond=1e-12)
    count = int(blocks.max()) + 1
    scores = np.zeros((count, j.shape[1]))
    np.add.at(scores, blocks, j * result.residuals[:, None])
    freedom = count / max(count - j.shape[1], 1)
    small = inverse @ (scores.T @ scores * freedom) @ inverse
    full = np.full((len(result.x), len(result.x)), np.nan)
    full[np.ix_(inside, inside)] = small
    return full


def known_covariance(result: Fit, blocks: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the table's parameters that the residuals determine, and their covariance, shape (p, p)."""
    scale = result.free.scale
    whole = covariance(result, blocks) * scale * scale[:, None]
    of_table = np.array([name in result.free.base.fields for name in result.free.names])
    known = np.flatnonzero(np.isfinite(np.diag(whole)) & of_table)
    return tuple(result.free.names[i] for i in known), whole[np.ix_(known, known)]


def estimates(result: Fit, blocks: np.ndarray) -> list[Estimate]:
    """Fitted parameters with their standard errors."""
    deviation = np.sqrt(np.diag(covariance(result, blocks))) * result.free.scale
    values = result.x * result.free.scale
    return [
        Estimate(f.name, float(v), float(s) if np.isfinite(s) else None, f.unit)
        for f, v, s in zip(result.free.free, values, deviation, strict=True)
    ]


def correlation(result: Fit, blocks: np.ndarray) -> np.ndarray:
    """Correlation matrix of the estimates, shape (p, p); NaN for parameters on a bound."""
    c = covariance(result, blocks)
    deviation = np.sqrt(np.diag(c))
    return np.asarray(c / np.outer(deviation, deviation))
