"""Frequency response between two recorded signals, with its coherence: the H1 estimate after Welch.

H1 = S_yu/S_uu from averaged periodograms of overlapping windows; noise on the response alone leaves it unbiased. The
coherence |S_yu|²/(S_uu S_yy) tells at which frequencies the response is that of a linear system to this input; the
standard deviation of the gain follows from it and from the number of independent windows (Bendat, Piersol, Random
Data, 9.2). The delay is the phase over the angular frequency, the phase followed from the lowest coherent frequency on.
Verified against a first-order lag with a dead time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd, welch

from shake_ros.core.quantities import ShakeError

Floats = NDArray[np.float64]
COHERENT = 0.9  # from which on the phase is followed from line to line
SHORTEST = 64  # samples of a window
REACH = 1000  # lines to which leakage is followed


@dataclass(frozen=True)
class FrequencyResponse:
    """Response per input on lines of frequency, all arrays of shape (m,).

    Attributes
    ----------
    frequency : [Hz]. response : complex gain [unit of response per unit of input]. coherence : 0 … 1 [-].
    leaked : share of the power at a line that the window may leak there from others, of the worse signal [-].
    deviation : relative standard deviation of the gain [-]. phase : continuous, 0 at rest [rad].
    windows : number of windows averaged.
    """

    frequency: Floats
    response: NDArray[np.complex128]
    coherence: Floats
    deviation: Floats
    phase: Floats
    windows: int
    leaked: Floats

    @property
    def gain(self) -> Floats:
        """Magnitude of the response, shape (m,)."""
        return np.asarray(np.abs(self.response))

    @property
    def delay(self) -> Floats:
        """Phase as a delay −phase/(2πf), shape (m,) [s]."""
        return np.asarray(-self.phase / (2.0 * np.pi * self.frequency))

    def at(self, frequency: float) -> tuple[float, float, float]:
        """Gain, delay [s] and coherence at a frequency [Hz], linear between the lines."""
        if not self.frequency[0] <= frequency <= self.frequency[-1]:
            raise ShakeError(f"{frequency:g} Hz is outside {self.frequency[0]:g} … {self.frequency[-1]:g} Hz")
        columns = (self.gain, self.delay, self.coherence)
        gain, delay, coherence = (float(np.interp(frequency, self.frequency, c)) for c in columns)
        return gain, delay, coherence


def frequency_response(given: Floats, answer: Floats, sample_time: float, window: float) -> FrequencyResponse:
    """The H1 estimate from `given` to `answer`.

    Parameters
    ----------
    given, answer : input and response, shape (n,). sample_time : [s].
    window : length of a window [s]; its inverse is the distance of the lines. Windows overlap by half.

    Raises
    ------
    ShakeError : a window is too short or longer than half of the signals, or the input is constant.

    Examples
    --------
    >>> u = np.random.default_rng(1).standard_normal(20000)
    >>> found = frequency_response(u, 2.0 * np.roll(u, 3), 1e-3, 0.5)
    >>> gain, delay = found.at(20.0)[:2]
    >>> round(gain, 1), round(delay, 4)  # gain 2, three samples late
    (2.0, 0.003)
    """
    length = round(window / sample_time)
    if length < SHORTEST or 2 * length > len(given):
        longest = 0.5 * len(given) * sample_time
        raise ShakeError(f"a window of {window:g} s: between {SHORTEST * sample_time:g} and {longest:g} s is possible")
    if np.ptp(given) == 0.0:
        raise ShakeError("the input is constant")
    options = {"fs": 1.0 / sample_time, "nperseg": length, "window": "hann", "detrend": "linear"}
    frequency, s_uu = welch(given, **options)
    _, s_yy = welch(answer, **options)
    _, s_uy = csd(given, answer, **options)
    tiny = 1e-300
    response = s_uy / np.maximum(s_uu, tiny)
    coherence = np.abs(s_uy) ** 2 / np.maximum(s_uu * s_yy, tiny)
    windows = 2 * (len(given) // length) - 1
    deviation = np.sqrt(np.maximum(1.0 - coherence, 0.0) / (np.maximum(coherence, 1e-12) * max(windows, 1)))
    keep = slice(1, None)
    phase = followed_phase(response[keep], coherence[keep])
    leaked = np.maximum(_leaked(s_uu), _leaked(s_yy))
    return FrequencyResponse(
        frequency[keep], response[keep], coherence[keep], deviation[keep], phase, windows, leaked[keep]
    )


def _leaked(power: Floats) -> Floats:
    """Most of the power at each line that a Hann window leaks there from lines two and more away, as a share [-]."""
    away = np.arange(2, max(3, min(len(power), REACH))) - 0.5  # a sine between two lines
    side = 1.0 / (np.pi * away * (away**2 - 1.0)) ** 2
    kernel = np.concatenate([side[::-1], np.zeros(3), side])
    return np.asarray(
        np.convolve(power, kernel)[len(side) + 1 : len(side) + 1 + len(power)] / np.maximum(power, 1e-300)
    )


def followed_phase(response: NDArray[np.complex128], coherence: Floats) -> Floats:
    """Phase without jumps of 2π along the coherent lines; on the others the branch nearest to the last of those."""
    raw = np.angle(response)
    phase = raw.copy()
    last = 0.0
    for i, angle in enumerate(raw):
        phase[i] = angle + 2.0 * np.pi * np.round((last - angle) / (2.0 * np.pi))
        if coherence[i] >= COHERENT:
            last = phase[i]
    return np.asarray(phase)
