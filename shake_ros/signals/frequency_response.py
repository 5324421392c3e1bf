"""Frequency responses: between two recorded signals, and of the table to sines of an amplitude.

`frequency_response` is the H1 estimate after Welch, with its coherence.

H1 = S_yu/S_uu from averaged periodograms of overlapping windows; noise on the response alone leaves it unbiased. The
coherence |S_yu|²/(S_uu S_yy) shows at which frequencies the response is that of a linear system to this input; the
standard deviation of the gain follows from it and from the number of independent windows (Bendat, Piersol, Random
Data, 9.2). The delay is the phase over the angular frequency, the phase followed from the lowest coherent frequency on.
Verified against a first-order lag with a dead time.

`describing_function` is gain and phase of the fundamental over amplitude and frequency of a sine.

The command A sin(2π f t) is held from sample to sample, as a controller sends it; the output is fitted over whole
periods, once the start has died away, by c + d t + a cos ωt + b sin ωt (the drift of an open-loop position is no
part of the fundamental). Gain and phase are those of (b + j a)/A, the hold's own half sample of delay included.
Source: thesis 4.3; section 10 of the equation sheet. Verified against the closed forms of the spool's linear
response and of a backlash.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd, welch

from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import COLUMNS, initial_state, run_batch
from shake_ros.quantities import ShakeError, unknown_name

Floats = NDArray[np.float64]
COHERENT = 0.9  # from which on the phase is followed from line to line
SHORTEST = 64  # samples of a window
REACH = 1000  # lines to which leakage is followed


@dataclass(frozen=True)
class FrequencyResponse:
    """Response per input on lines of frequency, all arrays of shape (m,)."""

    frequency: Floats  # [Hz]
    response: NDArray[np.complex128]  # complex gain [unit of response per unit of input]
    coherence: Floats  # 0 … 1 [-]
    deviation: Floats  # relative standard deviation of the gain [-]
    phase: Floats  # continuous, 0 at rest [rad]
    windows: int  # number of windows averaged
    leaked: Floats  # share of the power at a line that the window may leak there from others, of the worse signal [-]
    power: Floats  # density of the input's, one-sided [unit of input squared/Hz]

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
    given, answer : input and response, shape (n,).
    sample_time : [s].
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
        frequency[keep], response[keep], coherence[keep], deviation[keep], phase, windows, leaked[keep], s_uu[keep]
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


@dataclass(frozen=True)
class DescribingFunction:
    """Fundamental of an output per command."""

    output: str  # name of the output
    amplitudes: Floats  # of the command, shape (m,) [-]
    frequencies: Floats  # shape (n,) [Hz]
    # complex, shape (m, n) [unit of the output]; its magnitude is the gain, its angle the phase [rad]
    response: NDArray[np.complex128]

    @property
    def gain(self) -> Floats:
        """Amplitude of the fundamental per amplitude of the command, shape (m, n)."""
        return np.asarray(np.abs(self.response))

    @property
    def phase(self) -> Floats:
        """Phase of the fundamental against the command, shape (m, n) [rad]."""
        return np.asarray(np.angle(self.response))


def fundamental(signal: Floats, frequency: float, sample_time: float, start: int) -> complex:
    """Complex amplitude b + j a of `signal` ≈ c + d t + a cos ωt + b sin ωt, fitted from sample `start` on.

    >>> t = np.arange(1000) * 1e-3
    >>> abs(complex(np.round(fundamental(3.0 * np.sin(2 * np.pi * 5.0 * t) + t, 5.0, 1e-3, 0), 9)))
    3.0
    """
    t = np.arange(len(signal))[start:] * sample_time
    angle = 2.0 * np.pi * frequency * t
    columns = np.column_stack([np.sin(angle), np.cos(angle), np.ones_like(t), t - t.mean()])
    b, a, _, _ = np.linalg.lstsq(columns, signal[start:], rcond=None)[0]
    return complex(b, a)


def describing_function(
    table: TableParameters,
    amplitudes: Floats,
    frequencies: Floats,
    *,
    output: str = "velocity",
    sample_time: float = 1e-3,
    settling: float = 0.5,
    periods: int = 4,
) -> DescribingFunction:
    """Gain and phase of the fundamental of one of the simulation's outputs, all amplitudes of a frequency in one
    batch.

    Parameters
    ----------
    amplitudes : of the command, shape (m,), 0 … 1 [-].
    frequencies : shape (n,), below half the sampling rate [Hz].
    output : one of `simulation.COLUMNS`.
    settling : time before the fit, at least [s]; two periods where those last longer.
    periods : whole periods that the fit takes.

    Raises
    ------
    ShakeError : an amplitude or frequency outside its range, an unknown output.

    Examples
    --------
    >>> import shake_ros as sr
    >>> found = sr.describing_function(sr.model().table, np.array([0.1, 0.2]), np.array([2.0]))
    >>> found.gain[:, 0].round(2).tolist()  # [m/s]
    [0.64, 0.63]
    """
    if output not in COLUMNS:
        raise unknown_name("output", output, COLUMNS)
    if np.any((amplitudes <= 0.0) | (amplitudes > 1.0)):
        raise ShakeError("amplitudes of a command are above 0 and at most 1")
    if np.any((frequencies <= 0.0) | (frequencies >= 0.5 / sample_time)):
        raise ShakeError(f"frequencies are above 0 and below {0.5 / sample_time:g} Hz")
    vector = table.vector()
    vectors = np.tile(vector, (len(amplitudes), 1))
    starts = np.tile(initial_state(vector), (len(amplitudes), 1))
    response = np.empty((len(amplitudes), len(frequencies)), dtype=complex)
    for j, frequency in enumerate(frequencies):
        before = max(settling, 2.0 / frequency)
        length = round((before + periods / frequency) / sample_time)
        sine = np.sin(2.0 * np.pi * frequency * np.arange(length) * sample_time)
        columns = (COLUMNS.index(output),)
        runs = run_batch(vectors, starts, np.outer(amplitudes, sine), sample_time, columns=columns)
        start = length - round(periods / frequency / sample_time)
        for i, amplitude in enumerate(amplitudes):
            response[i, j] = fundamental(runs[i, :, 0], float(frequency), sample_time, start) / amplitude
    return DescribingFunction(output, amplitudes, frequencies, response)
