"""The moved mass from the forces of a run: what the chamber pressures push, over the acceleration.

    A (P_A − α P_B) = M a + c tanh(v/v_c) + b v + F_0

is fitted by least squares to the samples at which the table slides, all signals below the same zero-phase filter; the
friction's form only has to take what is in phase with the velocity. A specimen that sways counts with what it moves on
average. Newton's law; not in the thesis.
Verified against: simulated tables of known loads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.identification.velocity_filter import derivative, low_pass
from shake_ros.core.quantities import ShakeError

Array = NDArray[np.float64]
SLIDING = 0.2  # of the velocity's rms, above which the table surely slides


class Weighed(NamedTuple):
    """Moved mass M and its standard error [kg]."""

    mass: float
    std_error: float


def weigh(force: Array, acceleration: Array, position: Array, sample_time: float) -> Weighed:
    """M of a run from the force of the pressures [N], acceleration [m/s²] and position [m], (n,) each.

    Raises
    ------
    ShakeError : a run that hardly moves, or arrays of different lengths.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> a, x = -np.sin(9.0 * t), np.sin(9.0 * t) / 81.0
    >>> round(weigh(650.0 * a + 100.0 * np.tanh(20.0 * np.cos(9.0 * t)), a, x, 0.001).mass)
    650
    """
    if len({len(force), len(acceleration), len(position)}) != 1:
        raise ShakeError("weigh: needs force, acceleration and position of one length")
    velocity = derivative(position, sample_time)
    usual = float(np.sqrt(np.mean(velocity**2)))
    sliding = np.abs(velocity) > SLIDING * usual
    if not usual > 0.0 or np.count_nonzero(sliding) < 100:
        raise ShakeError("weigh: the run hardly moves")
    pushed, felt = low_pass(force, sample_time)[sliding], low_pass(acceleration, sample_time)[sliding]
    v = velocity[sliding]
    columns = np.column_stack([felt, np.tanh(v / (SLIDING * usual)), v, np.ones_like(v)])
    found, *_ = np.linalg.lstsq(columns, pushed, rcond=None)
    left = float(np.mean((pushed - columns @ found) ** 2))
    spread = np.linalg.inv(columns.T @ columns)[0, 0]
    return Weighed(float(found[0]), float(np.sqrt(left * spread)))
