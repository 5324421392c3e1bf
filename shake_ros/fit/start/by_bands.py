"""A fit that begins with what is slow: of the way to an effect whose valley is hardly met otherwise.

The ringing of backlash contacts follows its parameters so fast that the sum of squares of a free run is a maze within
some per cent of the truth. What lies below 40 Hz is a single valley from far off. So the residuals go through a
low-pass, zero-phase as that of the velocity, first at 40 Hz, then at 120 and 300 Hz, each fit with differences that
step over what ripples there; between them the effect's own parameters, which the slow part may leave open (the mass on
the piston's side), are tried one after the other on the whole of the residuals, and friction is split anew.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Problem, costs, fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.time_budget import time_is_over


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
FALL = 2.0  # times the cost that is of use at the end, to which a band must come
TRIED = 24  # values of each
FRICTION = ("friction.coulomb_level", "friction.stribeck_rise", "friction.stribeck_decay")
PARTS, SHARES, DECAYS = (0.85, 1.0, 1.2), (0.3, 0.5, 0.7, 0.9), (5.0, 15.0, 45.0)  # of friction at rest; [s/m]


def from_slow_to_fast(
    problem: RecordingProblem,
    free: FreeParameters,
    starts: Sequence[np.ndarray],
    own: Sequence[str],
    most: float = np.inf,
) -> np.ndarray:
    """Where a fit leads, band by band, from the best of some starts, shape (p,).

    Parameters
    ----------
    starts : values of the free parameters, shape (p,) each. own : names of those that are tried one by one, the least
    known first, three at most. most : half the sum of squares that is of use; the way ends after a band that leaves
    FALL times as much. When the time budget is over it ends where it is.
    """
    x = _best(slow(problem), free, np.array(starts))
    for band in BANDS:
        if time_is_over():
            break
        band_limited = problem.below(band.below, band.difference)
        x = _fitted(band_limited, band, free, x, own)
        if time_is_over() or costs(band_limited, free, x)[0] > FALL * most:  # all that rings comes on top
            break
        x = _tried(problem, band, free, x, own)
        if costs(problem, free, x)[0] > FALL * most:
            break
        anew = _best(band_limited, free, _with_friction_split(free, x))
        if not np.array_equal(anew, x):
            x = _tried(problem, band, free, _fitted(band_limited, band, free, anew, own), own)
    return x


def slow(problem: RecordingProblem) -> RecordingProblem:
    """The slow motion alone, in the first band."""
    return problem.below(BANDS[0].below, BANDS[0].difference)


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
    return _best(problem, free, rows)


def _best(problem: Problem, free: FreeParameters, rows: np.ndarray) -> np.ndarray:
    """The row that leaves the least sum of squares, shape (p,)."""
    return np.asarray(rows[int(np.argmin(costs(problem, free, rows)))])
