"""The lag that valve and delay share, parted anew: a leap along a valley that a fit follows in small steps only.

Far below its natural frequency a valve lags by 2ζ/ω, which only what is right to some per cent tells from a delay.
Between the ways to part the lag the valley bends, and a fit comes along it by some per mil a step. So a few of them are
tried: each is simulated once, everything else adjusts to first order (as effects are screened), and the fit goes on
from the one that promises most.
"""

from __future__ import annotations

import itertools

import numpy as np

from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import LOST, Adjustment, Fit, Problem, fit

FREQUENCY, DAMPING, DELAY = OF_LAG = ("valve.natural_frequency", "valve.damping", "effects.command_delay.delay")
DAMPINGS, DELAYED = (0.5, 0.7, 1.0), (0.0, 0.3, 0.6, 0.9)  # of the valve; part of the lag that is a delay
PROMISED = 0.97  # part of the cost that a leap must promise
FURTHEST = 3.0  # first-order change of another parameter that is followed, in its scales or of its value
EVALUATIONS = 10  # of the fit from there


def parted_anew(free: FreeParameters, x: np.ndarray) -> np.ndarray:
    """Points of the same lag of valve and delay parted otherwise, shape (m, p); none where not all three are free."""
    if not set(OF_LAG) <= set(free.names):
        return np.zeros((0, len(x)))
    columns = [free.names.index(name) for name in OF_LAG]
    frequency, damping, delay = x[columns] * free.scale[columns]
    lag = 2.0 * damping / frequency + delay
    parts = itertools.product(DAMPINGS, DELAYED)
    points = np.array([(2.0 * zeta / (lag * (1.0 - part)), zeta, lag * part) for zeta, part in parts])
    rows = np.tile(x, (len(points), 1))
    rows[:, columns] = points / free.scale[columns]
    return np.clip(rows, free.low, free.high)


def with_lag_parted(problem: Problem, found: Fit, tolerance: float) -> Fit:
    """A fit, or a better one whose lag is parted otherwise between valve and delay.

    Parameters
    ----------
    tolerance : relative change of the cost and of x at which the other one stops.
    """
    free, x = found.free, found.x
    rows = parted_anew(free, x)
    if not len(rows):
        return found
    residuals = np.nan_to_num(problem.residuals(free.vectors(rows)), nan=LOST).T
    promised = 0.5 * np.sum(Adjustment(found.jacobian).left(residuals) ** 2, axis=0)
    best = int(np.argmin(promised))
    if promised[best] > PROMISED * found.cost:
        return found
    others = np.array([name not in OF_LAG for name in free.names])  # those of the lag have another slope there
    change = np.linalg.lstsq(found.jacobian[:, others], -residuals[:, best], rcond=1e-10)[0]
    most = FURTHEST * np.maximum(1.0, np.abs(x[others]))
    start = rows[best].copy()
    start[others] += np.clip(change, -most, most)
    other = fit(problem, free, start, evaluations=EVALUATIONS, tolerance=tolerance)
    return other.after(found.evaluations) if other.cost < found.cost else found
