"""Elastic response spectrum of an acceleration of the ground, or of a table.

Each oscillator ẍ + 2ξω ẋ + ω² x = −a(t) is advanced exactly for an acceleration that is linear between samples.
Source: N. C. Nigam and P. C. Jennings, Bulletin of the Seismological Society of America 59 (1969), 909–922.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.quantities import ShakeError

Array = NDArray[np.float64]

STEPS_PER_PERIOD = 40.0
"""Least number of steps in a period: a peak between two of them is missed by at most 0.3 %."""


@njit
def _largest(acceleration, time_step, omega, damping):  # type: ignore[no-untyped-def]
    """Largest |x| and |ẍ + a| of one oscillator from rest."""
    parts = max(1, int(np.ceil(time_step * omega * STEPS_PER_PERIOD / (2.0 * np.pi))))
    h = time_step / parts
    root = math.sqrt(1.0 - damping**2)
    decay = math.exp(-damping * omega * h)
    s, c = math.sin(omega * root * h), math.cos(omega * root * h)
    a11, a12 = decay * (c + damping / root * s), decay * s / (omega * root)
    a21, a22 = -decay * omega / root * s, decay * (c - damping / root * s)
    x, v = 0.0, 0.0
    largest, total = 0.0, abs(acceleration[0])
    for i in range(acceleration.size - 1):
        rate = -(acceleration[i + 1] - acceleration[i]) / time_step
        for j in range(parts):
            load = -acceleration[i] + rate * h * j
            v_p = rate / omega**2  # particular solution: x_p + v_p t
            x_p = load / omega**2 - 2.0 * damping * v_p / omega
            dx, dv = x - x_p, v - v_p
            x = x_p + v_p * h + a11 * dx + a12 * dv
            v = v_p + a21 * dx + a22 * dv
            largest = max(largest, abs(x))
            total = max(total, abs(2.0 * damping * omega * v + omega**2 * x))
    return largest, total


@njit
def _spectrum(acceleration, time_step, periods, damping):  # type: ignore[no-untyped-def]
    result = np.empty((periods.size, 2))
    for i in range(periods.size):
        largest, total = _largest(acceleration, time_step, 2.0 * np.pi / periods[i], damping)
        result[i, 0] = largest
        result[i, 1] = total
    return result


def response_spectrum(
    acceleration: Array, time_step: float, periods: Array, damping: float
) -> tuple[Array, Array, Array]:
    """Displacement, pseudo-velocity and absolute acceleration spectra.

    Parameters
    ----------
    acceleration : (n,) [m/s²], linear between samples; the oscillators start at rest.
    time_step : [s].
    periods : (m,) natural periods above zero [s].
    damping : ξ within 0 … 1, 1 excluded [-].

    Returns
    -------
    largest relative displacement [m], ω times that [m/s], largest absolute acceleration [m/s²]; each (m,).

    Raises
    ------
    ShakeError for periods or damping outside their range, or fewer than two samples.
    """
    a = np.ascontiguousarray(acceleration, dtype=np.float64)
    t = np.ascontiguousarray(periods, dtype=np.float64)
    if not 0.0 <= damping < 1.0:
        raise ShakeError(f"response spectrum: damping = {damping:g} is outside 0 … 1")
    if t.size == 0 or not np.all(t > 0.0):
        raise ShakeError("response spectrum: periods must be above 0 s")
    if a.size < 2 or not time_step > 0.0:
        raise ShakeError(f"response spectrum: {a.size} samples at {time_step:g} s are no record")
    result = _spectrum(a, float(time_step), t, float(damping))
    return result[:, 0], 2.0 * np.pi / t * result[:, 0], result[:, 1]
