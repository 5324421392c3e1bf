"""A motion whose response spectrum is a wanted one: first its Fourier amplitudes, then wavelets, are adjusted.

Wavelets: L. Al Atik and N. Abrahamson, Earthquake Spectra 26 (2010), 601–617, tapered cosines whose place makes the
oscillator's response to each largest where its response to the record is. A_i(t_i), the response of oscillator i at
the time of its peak to wavelet j, is a matrix C; C b = what is missing gives the amplitudes b. The wavelets hold no
static part, so velocity and displacement stay near rest, and `baseline.end_at_rest` takes out what is left.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.analysis.oscillators import peaks

Array = NDArray[np.float64]
COUPLING = 0.7  # share of the off-diagonal terms that is solved for: more spoils the record, as the authors say
RIDGE = 0.3  # of the mean diagonal: neighbours that peak together do not fight with large wavelets
WIDTH, SLOPE = 1.178, -0.93  # γ = WIDTH f^SLOPE [s], of the authors
CLOSE_ENOUGH = 0.01  # rms difference of the logarithms at which the corrections end


def scale_amplitudes(record: Array, time_step: float, frequencies: Array, target: Array, damping: float) -> Array:
    """The record with its Fourier amplitudes multiplied by target over response spectrum, its phases kept."""
    found = np.abs(peaks(record, time_step, frequencies, damping)[0])
    f = np.fft.rfftfreq(record.size, time_step)
    ratio = np.interp(np.log(np.maximum(f, 1e-9)), np.log(frequencies), np.log(target / found))
    return np.asarray(np.fft.irfft(np.fft.rfft(record) * np.exp(ratio), record.size))


def correct(record: Array, time_step: float, frequencies: Array, target: Array, damping: float, rounds: int) -> Array:
    """The record with wavelets added, the best of `rounds` (n,) [m/s²]; a round that makes it worse is halved."""
    best, least, step = record, math.inf, 1.0
    now, addition = record, np.zeros_like(record)
    for _ in range(rounds + 1):
        values, times = peaks(now, time_step, frequencies, damping)
        off = float(np.sqrt(np.mean(np.square(np.log(np.abs(values) / target)))))
        if off < least:
            best, least, step = now, off, min(1.0, 1.5 * step)
            missing = np.sign(values) * (target - np.abs(values))
            addition = _correction(record.size, time_step, frequencies, damping, times, missing)
        else:
            step *= 0.5
        if least < CLOSE_ENOUGH:
            break
        now = best + step * addition
    return best


def _correction(n: int, h: float, frequencies: Array, damping: float, times: Array, missing: Array) -> Array:
    """The sum of the wavelets that adds `missing` (m,) to the responses at `times` (m,)."""
    t = np.arange(n) * h
    omega = 2.0 * math.pi * frequencies
    damped = omega * math.sqrt(1.0 - damping**2)
    lead = np.arctan(math.sqrt(1.0 - damping**2) / damping) / damped
    since = t[:, None] - (times - lead)
    waves = np.cos(damped * since) * np.exp(-((since / (WIDTH * frequencies**SLOPE)) ** 2))
    tau = times[:, None] - t
    past = np.maximum(tau, 0.0)
    sine = omega[:, None] * (1.0 - 2.0 * damping**2) / math.sqrt(1.0 - damping**2) * np.sin(damped[:, None] * past)
    cosine = 2.0 * damping * omega[:, None] * np.cos(damped[:, None] * past)
    answer = np.where(tau >= 0.0, np.exp(-damping * omega[:, None] * past) * (sine + cosine), 0.0) * h
    c = answer @ waves
    own = np.diag(np.diag(c))
    c = own + COUPLING * (c - own)
    ridge = (RIDGE * float(np.mean(np.abs(np.diag(c))))) ** 2 * np.eye(times.size)
    return np.asarray(waves @ c.T @ np.linalg.solve(c @ c.T + ridge, missing))
