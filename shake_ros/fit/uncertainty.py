"""Standard errors of fitted parameters, honest about residuals that are correlated in time.

The normal matrix JᵀJ of (4.10) gives the curvature; the scatter of its right-hand side Jᵀr is estimated from blocks of
time (a sandwich estimate), so filtered velocities and a small unmodelled rest do not shrink the errors. Parameters that
rest on a bound carry no standard error.

Noise is not all that an estimate may be off by. Near rest the model takes regularised forms, a smooth sign of the
velocity and a laminar stretch of the flow's root, whose widths are assumed; a table passes rest in its own way, and the
fitted values are then those of the nearest model. How far such a choice moves each of them follows to first order from
the change of the residuals, δ = −(JᵀJ)⁻¹ Jᵀ (r' − r), with each width a factor SPREAD larger and smaller: an
uncertainty of type B (JCGM 100:2008, 4.3), stated beside the one of noise. A width that was fitted is that of the
nearest form of this shape; what another shape does is as uncertain, so the others are shifted with it held.

The model's root also reaches √Δp soon (valve/ports.py), where that of a real orifice, (2.77), comes up to it slowly,
from below. Δp/√(|Δp| + δ), of the same slope at rest, stays δ/(2 Δp) behind: to first order as if the supply stood δ
lower and the tank δ higher. A root may lie anywhere between the two, a rectangular distribution of that half-width.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.fit.free_parameters import FreeParameters, is_of_recording
from shake_ros.fit.least_squares import Adjustment, Fit, Problem

LAMINAR = "valve.laminar_pressure"
NEAR_REST = ("friction.transition_velocity", LAMINAR)
DROP = ("supply.supply_pressure", "supply.tank_pressure")
# Standard factor of such a width. A smooth sign and a linear ramp that take the same off a step have slopes at rest
# that differ by 2 ln 2, so between forms a width means no more than that; at even odds, ln SPREAD = ln(2 ln 2)/√3.
SPREAD = (2.0 * math.log(2.0)) ** (1.0 / math.sqrt(3.0))


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter: value and standard error in its unit; None where it rests on a bound or does not act.

    form_error : standard deviation by the assumed widths of what is regularised near rest, in the same unit.
    """

    name: str
    value: float
    std_error: float | None
    unit: str
    form_error: float = 0.0

    @property
    def deviation(self) -> float | None:
        """Standard deviation by noise and by the assumed forms; None where there is no standard error."""
        return None if self.std_error is None else math.hypot(self.std_error, self.form_error)


def at_bound(result: Fit) -> np.ndarray:
    """Which parameters rest on a bound, shape (p,)."""
    return resting(result.x, result.free.low, result.free.high)


def resting(x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Which values, in units of their scales, rest on a bound, shape (p,)."""
    width = 1e-3 * np.minimum(1.0, high - low)
    return np.asarray((x - low < width) | (high - x < width))


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


def of_table(result: Fit) -> Fit:
    """A fit of the table's parameters alone, where what is free of single recordings follows them."""
    own = np.array([is_of_recording(name) for name in result.free.names])
    if not np.any(own):
        return result
    followed = result.jacobian[:, own & np.any(result.jacobian != 0.0, axis=0)]
    free = FreeParameters(result.free.base, [f for f in result.free.free if not is_of_recording(f.name)])
    jacobian = Adjustment(followed).left(result.jacobian[:, ~own])
    return replace(result, free=free, x=result.x[~own], jacobian=jacobian)


def value_covariance(result: Fit, blocks: np.ndarray) -> np.ndarray:
    """Covariance of the fitted values in their units, shape (p, p); NaN as in `covariance`."""
    of_x, slopes = covariance(result, blocks), result.free.slopes(result.x)
    return np.asarray(np.where(np.isnan(of_x), np.nan, slopes @ np.nan_to_num(of_x) @ slopes.T))


def known_covariance(result: Fit, blocks: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the table's parameters that the residuals determine, and their covariance, shape (p, p)."""
    whole = value_covariance(result, blocks)
    declared = np.array([name in result.free.base.fields for name in result.free.names])
    known = np.flatnonzero(np.isfinite(np.diag(whole)) & declared)
    return tuple(result.free.names[i] for i in known), whole[np.ix_(known, known)]


def form_errors(problem: Problem, result: Fit) -> np.ndarray:
    """Standard deviation of x by the forms assumed near rest, in units of the scales, shape (p,)."""
    rows, variances = _other_forms(result)
    if not len(rows):
        return np.zeros(len(result.x))
    change = np.nan_to_num(problem.residuals(rows) - result.residuals)
    inside = ~at_bound(result) & np.any(result.jacobian != 0.0, axis=0)
    width = np.isin(result.free.names, NEAR_REST)
    shifts = np.zeros((len(rows), len(result.x)))
    shifts[:, inside & ~width] = -np.linalg.lstsq(result.jacobian[:, inside & ~width], change.T, rcond=1e-6)[0].T
    shifts[:, inside & width] = ((rows - result.vector)[:, result.free.columns] / result.free.scale)[:, inside & width]
    return np.asarray(np.sqrt(variances @ shifts**2))


def _other_forms(result: Fit) -> tuple[np.ndarray, np.ndarray]:
    """The table with each other form near rest, shape (m, n), and its part in the variance, shape (m,)."""
    column = {name: i for i, name in enumerate(result.free.base.fields)}
    fitted = result.free.vectors(result.x)[0]
    rows, variances = [], []
    for name in NEAR_REST:
        if name in column:
            for factor in (SPREAD, 1.0 / SPREAD):
                rows.append(fitted.copy())
                rows[-1][column[name]] *= factor
                variances.append(1.0 / 2.0)
    if LAMINAR in column:
        rows.append(fitted.copy())
        rows[-1][[column[n] for n in DROP]] += fitted[column[LAMINAR]] * np.array([-1.0, 1.0])
        variances.append(1.0 / 3.0)
    return np.array(rows), np.array(variances)


def estimates(result: Fit, blocks: np.ndarray, forms: np.ndarray | None = None) -> list[Estimate]:
    """Fitted parameters of the table with their standard errors; forms : from `form_errors`."""
    deviation = np.sqrt(np.diag(value_covariance(result, blocks)))
    values = result.free.values(result.x)
    by_form = np.zeros(len(values)) if forms is None else forms * result.free.scales(result.x)
    return [
        Estimate(f.name, float(v), float(s) if np.isfinite(s) else None, f.unit, float(e))
        for f, v, s, e in zip(result.free.free, values, deviation, by_form, strict=True)
        if not is_of_recording(f.name)
    ]


def correlation(result: Fit, blocks: np.ndarray) -> np.ndarray:
    """Correlation matrix of the estimates, shape (p, p); NaN for parameters on a bound."""
    c = covariance(result, blocks)
    deviation = np.sqrt(np.diag(c))
    return np.asarray(c / np.outer(deviation, deviation))
