"""A motion whose response spectrum is a wanted one: first its Fourier amplitudes, then wavelets, are adjusted.

Wavelets: L. Al Atik and N. Abrahamson, Earthquake Spectra 26 (2010), 601–617, tapered cosines whose place makes the
oscillator's response to each largest where its response to the record is. A_i(t_i), the response of oscillator i at
the time of its peak to wavelet j, is a matrix C; C b = what is missing gives the amplitudes b. The wavelets hold no
static part, so velocity and displacement stay near rest, and `baseline.end_at_rest` takes out what is left. The zero
period is one more row, the record itself where it is largest, with a wavelet of the last frequency centred there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.analysis.response_spectrum import response_spectrum

Array = NDArray[np.float64]
COUPLING = 0.7  # share of the off-diagonal terms that is solved for: more spoils the record, as the authors say
RIDGE = 0.3  # of the mean diagonal: neighbours that peak together do not fight with large wavelets
WIDTH, SLOPE = 1.178, -0.93  # γ = WIDTH f^SLOPE [s], of the authors
CLOSE_ENOUGH = 0.01  # rms difference of the logarithms at which the corrections end


def scale_amplitudes(record: Array, time_step: float, frequencies: Array, target: Array, damping: float) -> Array:
    """The record with its Fourier amplitudes multiplied by target over response spectrum, its phases kept."""
    found = np.abs(response_spectrum(record, time_step, frequencies, damping, band_limited=True).acceleration)
    f = np.fft.rfftfreq(record.size, time_step)
    ratio = np.interp(np.log(np.maximum(f, 1e-9)), np.log(frequencies), np.log(target / found))
    return np.asarray(np.fft.irfft(np.fft.rfft(record) * np.exp(ratio), record.size))


def correct(
    record: Array,
    time_step: float,
    frequencies: Array,
    target: Array,
    damping: float,
    rounds: int,
    zero_period: float = 0.0,
) -> Array:
    """The record with wavelets added, the best of `rounds` (n,) [m/s²]; a round that makes it worse is halved.

    A record whose largest acceleration lies below `zero_period` [m/s²] is raised there; a larger one is left.
    """
    best, least, step = record, math.inf, 1.0
    now, addition = record, np.zeros_like(record)
    for _ in range(rounds + 1):
        _, values, times = response_spectrum(now, time_step, frequencies, damping, band_limited=True)
        place = int(np.argmax(np.abs(now)))
        low = min(0.0, math.log(abs(float(now[place])) / zero_period)) if zero_period else 0.0
        missed = np.append(np.log(np.abs(values) / target), low)
        off = float(np.sqrt(np.mean(np.square(missed)))) + abs(low)
        if off < least:
            best, least, step = now, off, min(1.0, 1.5 * step)
            missing = np.sign(values) * (target - np.abs(values))
            rigid = math.copysign(zero_period - abs(float(now[place])), float(now[place])) if low < 0.0 else 0.0
            waves, c = _coupled(record.size, time_step, frequencies, damping, times, place * time_step)
            addition = waves @ _amplitudes(c, np.append(missing, rigid))
        else:
            step *= 0.5
        if least < CLOSE_ENOUGH:
            break
        now = best + step * addition
    return best


def _coupled(n: int, h: float, frequencies: Array, damping: float, times: Array, peak: float) -> tuple[Array, Array]:
    """Wavelets (n, m + 1), and what each adds to the responses at `times` and to the record at `peak`, square."""
    t = np.arange(n) * h
    omega = 2.0 * math.pi * frequencies
    damped = omega * math.sqrt(1.0 - damping**2)
    lead = np.arctan(math.sqrt(1.0 - damping**2) / damping) / damped
    centres, rates = np.append(times - lead, peak), np.append(damped, damped[-1])
    widths = WIDTH * np.append(frequencies, frequencies[-1]) ** SLOPE
    since = t[:, None] - centres
    waves = np.cos(rates * since) * np.exp(-((since / widths) ** 2))
    tau = times[:, None] - t
    past = np.maximum(tau, 0.0)
    sine = omega[:, None] * (1.0 - 2.0 * damping**2) / math.sqrt(1.0 - damping**2) * np.sin(damped[:, None] * past)
    cosine = 2.0 * damping * omega[:, None] * np.cos(damped[:, None] * past)
    answer = np.where(tau >= 0.0, np.exp(-damping * omega[:, None] * past) * (sine + cosine), 0.0) * h
    return waves, np.vstack([answer @ waves, waves[round(peak / h)]])


def _amplitudes(c: Array, missing: Array) -> Array:
    """Amplitudes of the wavelets that add `missing` to what `c` couples them to.

    The record itself, the last, is weighed as the oscillators, whose resonance makes much more of their wavelets.
    """
    weight = np.ones(len(c))
    weight[-1] = math.sqrt(float(np.mean(np.abs(np.diag(c)[:-1]))))
    return weight * _solved(weight[:, None] * c * weight, weight * missing)


def _solved(c: Array, missing: Array) -> Array:
    """b of C b = missing, its couplings lessened and with a ridge."""
    own = np.diag(np.diag(c))
    c = own + COUPLING * (c - own)
    ridge = (RIDGE * float(np.mean(np.abs(np.diag(c))))) ** 2 * np.eye(len(c))
    return np.asarray(c.T @ np.linalg.solve(c @ c.T + ridge, missing))
