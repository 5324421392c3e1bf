"""Ways into the narrow valleys of free runs: by predictor runs, from slow to fast, along the lag of valve and delay.

A free run keeps every error of phase of the oil column and every late crossing of a threshold, so its sum of squares is
a maze of narrow valleys in which Gauss-Newton steps take off some per cent each.

Predictor runs: a simulation that is corrected by what the sensors show beyond it (`inject` in plant/integration.py), as
an observer is, forgets such errors within 1/INJECTION; its prediction error is nearly linear and leads to the
neighbourhood of the solution in a few steps. The free run has the last word: the end of that way is a start, taken
where the free run is better there.

From slow to fast: the ringing of backlash contacts follows its parameters so fast that the sum of squares is a maze
within some per cent of the truth. What lies below 40 Hz is a single valley from far off. So the residuals go through a
low-pass, zero-phase as that of the velocity, first at 40 Hz, then at 120 and 300 Hz, each fit with differences that
step over what ripples there; between them the effect's own parameters, which the slow part may leave open (the mass on
the piston's side), are tried one after the other on the whole of the residuals, and friction is split anew.

The shared lag: far below its natural frequency a valve lags by 2ζ/ω, which only what is right to some per cent tells
from a delay. Between the ways to part the lag the valley bends, and a fit comes along it by some per mil a step. So a
few of them are tried: each is simulated once, everything else adjusts to first order (as effects are screened), and the
fit goes on from the one that promises most.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import LOST, Adjustment, Fit, Problem, best_start, fit, time_is_over
from shake_ros.fit.recording_problem import RecordingProblem

INJECTION = 40.0  # [1/s] slow beside the oil column, fast beside the time over which a free run loses its phase
PREDICTOR_EVALUATIONS, PREDICTOR_TOLERANCE = 12, 1e-3  # of a fit of predictor runs, at most and at least


class PredictorProblem(Problem, Protocol):
    """A problem whose runs may be corrected towards the measurement at a rate [1/s]; 0 for free runs."""

    def predictor(self, injection: float) -> Problem:
        """The same problem with predictor runs; itself where its runs cannot be corrected."""


def approached(
    problem: PredictorProblem,
    free: FreeParameters,
    start: np.ndarray,
    *,
    evaluations: int = 40,
    tolerance: float = 1e-4,
    near: float = 0.0,
) -> Fit:
    """`fit` to free runs from the better of `start` and where a fit of predictor runs leads from there.

    near : mean square of the residuals at which the start is near the end, and no way to it is needed.
    """
    way = predictor_start(problem, free, start, evaluations=evaluations, tolerance=tolerance, near=near)
    return arrived(problem, free, way, evaluations=evaluations, tolerance=tolerance)


@dataclass(frozen=True)
class Approach:
    """The way to a fit of free runs. start : where it begins. predictor : the fit of predictor runs, if any."""

    start: np.ndarray
    predictor: Fit | None = None

    @property
    def predictor_cost(self) -> float:
        """Half the sum of squares that predictor runs leave; 0 without a predictor."""
        return self.predictor.cost if self.predictor is not None else 0.0


def predictor_start(
    problem: PredictorProblem,
    free: FreeParameters,
    start: np.ndarray,
    *,
    evaluations: int = 40,
    tolerance: float = 1e-4,
    near: float = 0.0,
) -> Approach:
    """The first part of `approached`: where a fit of predictor runs leads, if the free run is better there."""
    predictor = problem.predictor(INJECTION)
    if predictor is problem or (begun := _cost(problem, free, start)) <= near:
        return Approach(start)
    most, least = min(PREDICTOR_EVALUATIONS, evaluations), max(PREDICTOR_TOLERANCE, tolerance)
    way = fit(predictor, free, start, evaluations=most, tolerance=least)
    return Approach(way.x if _cost(problem, free, way.x) < begun else start, way)


def arrived(
    problem: PredictorProblem, free: FreeParameters, way: Approach, *, evaluations: int = 40, tolerance: float = 1e-4
) -> Fit:
    """The second part of `approached`: the fit of free runs."""
    result = fit(problem, free, way.start, evaluations=evaluations, tolerance=tolerance)
    return result if way.predictor is None else result.after(way.predictor.evaluations + 2)


def _cost(problem: Problem, free: FreeParameters, x: np.ndarray) -> float:
    """Mean square of the residuals; inf where the run ends in no number."""
    return float(np.nan_to_num(np.mean(problem.residuals(free.vectors(x))[0] ** 2), nan=np.inf))


class Band(NamedTuple):
    """One part of the way. below : [Hz]. difference : step of the fit. evaluations : its trial points, at most.

    widths : factors within which up to three own parameters are tried, the least known first. held : how many of these
    the fit holds, since it would let them run away.
    """

    below: float
    difference: float
    evaluations: int
    widths: tuple[float, ...]
    held: int = 0


BANDS = (
    Band(40.0, 5e-2, 10, (4.0, 1.5, 1.2), held=1),
    Band(120.0, 2e-2, 15, (1.5, 1.25, 1.1)),
    Band(300.0, 1e-2, 15, (1.25, 1.1, 1.03)),
)
TOLERANCE = 1e-3
TRIED = 24  # values of each
FRICTION = ("friction.coulomb_level", "friction.stribeck_rise", "friction.stribeck_decay")
PARTS, SHARES, DECAYS = (0.85, 1.0, 1.2), (0.3, 0.5, 0.7, 0.9), (5.0, 15.0, 45.0)  # of friction at rest; [s/m]


def from_slow_to_fast(
    problem: RecordingProblem, free: FreeParameters, start: np.ndarray, own: Sequence[str]
) -> np.ndarray:
    """Where a fit leads, band by band, shape (p,); when the time budget is over it ends where it is.

    Parameters
    ----------
    start : values of the free parameters, shape (p,).
    own : names of those that are tried one by one, the least known first, three at most.
    """
    x = start
    for band in BANDS:
        if time_is_over():
            break
        band_limited = problem.below(band.below, band.difference)
        x = _fitted(band_limited, band, free, x, own)
        if time_is_over():
            break
        x = _tried(problem, band, free, x, own)
        anew = best_start(band_limited, free, _with_friction_split(free, x))
        if not np.array_equal(anew, x):
            x = _tried(problem, band, free, _fitted(band_limited, band, free, anew, own), own)
    return x


def _fitted(band_limited: Problem, band: Band, free: FreeParameters, x: np.ndarray, own: Sequence[str]) -> np.ndarray:
    """A fit within a band."""
    held = own[: band.held]
    moved = FreeParameters(free.table(x), [f for f in free.free if f.name not in held])
    found = fit(band_limited, moved, moved.start(), evaluations=band.evaluations, tolerance=TOLERANCE)
    return FreeParameters(moved.table(found.x), free.free).start()


def _tried(problem: Problem, band: Band, free: FreeParameters, x: np.ndarray, own: Sequence[str]) -> np.ndarray:
    """x with the best of own parameters, tried one after the other on the whole of the residuals."""
    for name, width in zip(own, band.widths, strict=False):
        x = _best_along(problem, free, x, free.names.index(name), width)
    return x


def _with_friction_split(free: FreeParameters, x: np.ndarray) -> np.ndarray:
    """x first, then x with friction at rest split between its Coulomb level and the rise anew, shape (m, p).

    While an effect was amiss a fit has bent the friction, and the way back is a long valley.
    """
    columns = [free.names.index(name) for name in FRICTION if name in free.names]
    if len(columns) < len(FRICTION):
        return x[None, :]
    level, rise, _ = x[columns] * free.scale[columns]
    anew = [
        (part * share * (level + rise), part * (1.0 - share) * (level + rise), decay)
        for part, share, decay in itertools.product(PARTS, SHARES, DECAYS)
    ]
    rows = np.tile(x, (1 + len(anew), 1))
    rows[1:, columns] = np.array(anew) / free.scale[columns]
    return np.clip(rows, free.low, free.high)


def _best_along(problem: Problem, free: FreeParameters, x: np.ndarray, column: int, width: float) -> np.ndarray:
    """The best of x and of what has one parameter up to so many times larger or smaller."""
    rows = np.tile(x, (TRIED + 1, 1))
    rows[1:, column] *= np.geomspace(1.0 / width, width, TRIED)
    rows = np.clip(rows, free.low, free.high)
    return best_start(problem, free, rows)


FREQUENCY, DAMPING, DELAY = OF_LAG = ("valve.natural_frequency", "valve.damping", "effects.command_delay.delay")
DAMPINGS, DELAYED = (0.5, 0.7, 1.0), (0.0, 0.3, 0.6, 0.9)  # of the valve; part of the lag that is a delay
PROMISED = 0.97  # part of the cost that a leap must promise
FURTHEST = 3.0  # first-order change of another parameter that is followed, in its scales or of its value
LAG_EVALUATIONS = 10  # of the fit from there


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
    other = fit(problem, free, start, evaluations=LAG_EVALUATIONS, tolerance=tolerance)
    return other.after(found.evaluations) if other.cost < found.cost else found
