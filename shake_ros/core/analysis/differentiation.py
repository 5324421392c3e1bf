"""Velocity from sampled position, without phase shift."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import signal

from shake_ros.core.quantities import ShakeError

STENCIL = (4 / 5, -1 / 5, 4 / 105, -1 / 280)  # central difference of order 8: −0.6 % at 0.4 of the Nyquist frequency
SHORTEST = 2 * len(STENCIL) + 1
HIGHEST_CUTOFF = 0.9  # of the Nyquist frequency; above it there is nothing to filter


def velocity_from_position(
    position: npt.ArrayLike, sample_time: float, cutoff: float = 40.0, order: int = 8
) -> npt.NDArray[np.float64]:
    """Differentiate a position and remove what lies above the cutoff, with zero phase.

    The thesis (6.3.3.2) names "a Butterworth low-pass filter with order 8 and a bandwidth of 40 Hz" behind an
    approximate differentiation, without a word on its direction. Here order and bandwidth are those of the whole
    filter: two passes, forward and backward, of order/2 each, whose corner is moved so that both together
    have −3 dB at the cutoff. (`filtfilt` with order 8 would be of order 16, with −6 dB there.)

    Parameters
    ----------
    position : (n,) [m], equally spaced, finite, at least 9 samples.
    sample_time : distance of samples [s].
    cutoff : frequency of −3 dB [Hz]; from 0.9 of the Nyquist frequency on nothing is filtered.
    order : even, order of both passes together.

    Returns
    -------
    velocity : (n,) [m/s]; both ends (about 1/cutoff) are extrapolated by odd reflection and less certain.

    Raises
    ------
    ShakeError
        where the position is too short or not finite, or the order is not even and positive.

    Source: thesis 6.3.3.2; section 10 of the equation sheet.

    >>> time = np.arange(2000) * 0.001
    >>> velocity = velocity_from_position(0.01 * np.sin(2 * np.pi * 3.0 * time), 0.001)
    >>> round(float(velocity[1000]), 4)  # 0.01 m · 2π · 3 Hz
    0.1885
    """
    x = np.asarray(position, dtype=np.float64)
    if x.ndim != 1 or len(x) < SHORTEST:
        raise ShakeError(f"velocity needs a row of at least {SHORTEST} positions, got shape {x.shape}")
    if not np.isfinite(x).all():
        raise ShakeError(f"velocity needs finite positions, sample {int(np.argmax(~np.isfinite(x)))} is not")
    if order < 2 or order % 2:
        raise ShakeError(f"order = {order} of a filter in two passes must be even and positive")
    reach = len(STENCIL)
    extended = np.concatenate((2 * x[0] - x[reach:0:-1], x, 2 * x[-1] - x[-2 : -reach - 2 : -1]))
    velocity = np.zeros_like(x)
    for k, weight in enumerate(STENCIL, start=1):
        velocity += weight * (extended[reach + k : reach + k + len(x)] - extended[reach - k : reach - k + len(x)])
    return zero_phase(velocity / sample_time, sample_time, cutoff, order)


def zero_phase(
    values: npt.NDArray[np.float64], sample_time: float, cutoff: float, order: int = 8
) -> npt.NDArray[np.float64]:
    """The Butterworth filter of `velocity_from_position` alone.

    Parameters
    ----------
    values : (n,) in any unit.
    sample_time : [s].
    cutoff : frequency of −3 dB of both passes together [Hz].
    order : even, order of both passes together.

    Returns
    -------
    (n,) in the same unit.
    """
    nyquist = 0.5 / sample_time
    if cutoff >= HIGHEST_CUTOFF * nyquist:
        return values
    per_pass = order // 2
    # |H|² of a pass is 1/(1 + (w/w_pass)^(2·per_pass)), w = tan(π f/2f_N); it must be 1/√2 at the cutoff
    warped = math.tan(0.5 * math.pi * cutoff / nyquist) / (math.sqrt(2.0) - 1.0) ** (0.5 / per_pass)
    corner = 2.0 / math.pi * math.atan(warped)
    sections: Any = signal.butter(per_pass, corner, output="sos")
    padding = min(len(values) - 1, max(12, math.ceil(3.0 / (cutoff * sample_time))))
    filtered: npt.NDArray[np.float64] = signal.sosfiltfilt(sections, values, padlen=padding)
    return filtered
