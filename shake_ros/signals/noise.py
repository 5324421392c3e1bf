"""Noise of a recording: from repeated periods where the command repeats, else from the band above the dynamics.

What changes from period to period under a command that repeats to the last digits is noise whatever its spectrum; only
an open-loop recording has that. Elsewhere the highest frequencies, where the table no longer moves, tell the white
part. Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach (2012), 4.3.
"""

from __future__ import annotations

import math

import numpy as np

from shake_ros.signals.multisine_split import noise_from_periods, repeated_period

REPEATED = 1e-3  # change from period to period, relative to the command, up to which it repeats
FEWEST = 3  # whole periods that must be there: the first settles, two are compared


def white_deviation(values: np.ndarray) -> float:
    """Standard deviation of the white noise in a signal whose dynamics lie well below the sampling rate.

    The sixth difference removes the dynamics; its median magnitude is not fooled by the few samples about each jump of
    the friction force, whose spectrum reaches up to the Nyquist frequency. `values` of shape (n,), result in its unit.

    >>> noise = np.random.default_rng(1).standard_normal(100000)
    >>> slow = np.sin(np.arange(100000) / 10.0)
    >>> bool(abs(white_deviation(100.0 * slow + noise) - 1.0) < 0.02)
    True
    """
    sixth = np.diff(values, n=6)
    return float(
        np.median(np.abs(sixth)) / (0.674490 * math.sqrt(924.0))
    )  # 924 = Σ of the squared binomials of order 6


def resolution(values: np.ndarray) -> float:
    """Smallest step between the levels of a quantised signal, next to nothing where it is not quantised.

    >>> round(float(resolution(np.round(np.sin(np.arange(1000) / 50.0) / 0.005) * 0.005)), 6)
    0.005
    """
    levels = np.unique(values)
    steps = np.diff(levels)
    steps = steps[steps > 1e-6 * (levels[-1] - levels[0])]
    return float(steps.min()) if len(steps) else 0.0


def repetition(commands: np.ndarray) -> int | None:
    """Samples of the period with which a command repeats to its last digits, at least FEWEST times; None where not.

    >>> repetition(np.sin(2.0 * np.pi * np.arange(1000) / 80.0)), repetition(np.arange(1000.0))
    (80, None)
    """
    u = np.asarray(commands, dtype=float)
    period = repeated_period(u)
    if period is None or len(u) < FEWEST * period:
        return None
    change = u[period:] - u[:-period]
    size = float(np.std(u))
    return period if size > 0.0 and float(np.sqrt(np.mean(change**2))) <= REPEATED * size else None


def periodic_deviation(signal: np.ndarray, commands: np.ndarray) -> float | None:
    """Noise of a signal from the periods of the command [unit of the signal]; None where the command does not repeat.

    Parameters
    ----------
    signal, commands : shape (n,).
    """
    period = repetition(commands)
    return None if period is None else noise_from_periods(signal, period)


def samples_for_one(residuals: np.ndarray, reach: int) -> float:
    """Samples for each independent one, 1 + 2 Σ ρ² over lags up to `reach`, tapered; ρ is the autocorrelation.

    Source: M. S. Bartlett, Journal of the Royal Statistical Society B 8 (1946), for the variance of a mean square.

    >>> white = np.random.default_rng(1).standard_normal(20000)
    >>> round(samples_for_one(white, 100), 1)
    1.0
    """
    e = residuals - np.mean(residuals)
    reach = min(reach, len(e) - 1)
    product = np.fft.irfft(np.abs(np.fft.rfft(e, 2 * len(e))) ** 2)[: reach + 1]
    if product[0] <= 0.0:
        return 1.0
    taper = 1.0 - np.arange(1, reach + 1) / (reach + 1.0)
    chance = 1.0 / len(e)  # of the square of a correlation
    return float(1.0 + 2.0 * np.sum(taper * (np.square(product[1:] / product[0]) - chance)))
