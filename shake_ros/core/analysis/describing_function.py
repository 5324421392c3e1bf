"""Describing functions of the table: gain and phase of the fundamental over amplitude and frequency of a sine.

The command A sin(2π f t) is held from sample to sample, as a controller sends it; the output is fitted over whole
periods, once the start has died away, by c + d t + a cos ωt + b sin ωt (the drift of an open-loop position is no
part of the fundamental). Gain and phase are those of (b + j a)/A, the hold's own half sample of delay included.
Source: thesis 4.3; section 10 of the equation sheet. Verified against the closed forms of the spool's linear
response and of a play.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import COLUMNS, initial_state, run_batch
from shake_ros.core.quantities import ShakeError, unknown_name

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class DescribingFunction:
    """Fundamental of an output per command.

    Attributes
    ----------
    output : name of the output. amplitudes : of the command, shape (m,) [-]. frequencies : shape (n,) [Hz].
    response : complex, shape (m, n) [unit of the output]; its magnitude is the gain, its angle the phase [rad].
    """

    output: str
    amplitudes: Floats
    frequencies: Floats
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
    amplitudes : of the command, shape (m,), 0 … 1 [-]. frequencies : shape (n,), below half the sampling rate [Hz].
    output : one of `simulation.COLUMNS`. settling : time before the fit, at least [s]; two periods where those last
    longer. periods : whole periods that the fit takes.

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
