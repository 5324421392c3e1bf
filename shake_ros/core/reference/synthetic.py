"""Synthetic accelerogram: seeded noise through the Clough–Penzien filter, under the Saragoni–Hart envelope.

Sources: K. Kanai (1957) and H. Tajimi (1960) for the ground filter; R. W. Clough and J. Penzien, Dynamics of
Structures (1975), for the high-pass filter in series; G. R. Saragoni and G. C. Hart (1974) for the envelope,
with the constants of D. M. Boore, Pure and Applied Geophysics 160 (2003), 635–676, eq. (20)–(23).
The noise is numpy's `RandomState`, whose stream is frozen, so a seed means the same record with every version.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.reference.motion import Array, EarthquakeRecord


def ground_filter(
    frequency: Array, ground: tuple[float, float], high_pass: tuple[float, float]
) -> NDArray[np.complex128]:
    """Complex transfer function from rock to ground acceleration at `frequency` [Hz], shape of `frequency`.

    Parameters
    ----------
    ground : frequency f_g [Hz] and damping ξ_g [-] of Kanai and Tajimi.
    high_pass : frequency f_f [Hz] and damping ξ_f [-] of Clough and Penzien.
    """
    f = np.asarray(frequency, dtype=np.float64)
    (f_g, xi_g), (f_f, xi_f) = ground, high_pass
    kanai_tajimi = (f_g**2 + 2j * xi_g * f_g * f) / (f_g**2 - f**2 + 2j * xi_g * f_g * f)
    clough_penzien = -(f**2) / (f_f**2 - f**2 + 2j * xi_f * f_f * f)
    return np.asarray(kanai_tajimi * clough_penzien, dtype=np.complex128)


def envelope(time: Array, duration: float, peak_place: float, end_level: float) -> Array:
    """Saragoni–Hart envelope a (t/T)^b exp(−c t/T): 1 at t = peak_place·T, `end_level` at t = T = `duration`."""
    b = -peak_place * np.log(end_level) / (1.0 + peak_place * (np.log(peak_place) - 1.0))
    c = b / peak_place
    tau = np.asarray(time, dtype=np.float64) / duration
    return np.asarray((tau / peak_place) ** b * np.exp(b - c * tau))


def accelerogram(
    seed: int,
    duration: float,
    time_step: float,
    ground: tuple[float, float],
    high_pass: tuple[float, float],
    peak_place: float,
    end_level: float,
    peak: float,
) -> EarthquakeRecord:
    """A record of `duration` [s] at `time_step` [s] whose largest magnitude is `peak` [m/s²].

    `ground` and `high_pass` as in `ground_filter`, `peak_place` and `end_level` as in `envelope`.
    """
    count = round(duration / time_step) + 1
    time: Array = np.arange(count, dtype=np.float64) * time_step
    noise = np.random.RandomState(seed).standard_normal(count)
    padded = 2 * count  # room for the filter's ringing, so that the end does not wrap to the start
    frequency = np.asarray(np.fft.rfftfreq(padded, time_step), dtype=np.float64)
    spectrum = np.fft.rfft(noise, padded) * ground_filter(frequency, ground, high_pass)
    shaped = np.fft.irfft(spectrum, padded)[:count] * envelope(time, duration, peak_place, end_level)
    return EarthquakeRecord(time, shaped * (peak / np.max(np.abs(shaped))))
