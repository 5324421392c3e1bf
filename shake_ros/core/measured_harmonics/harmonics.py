"""Harmonic amplitudes of the acceleration under sinusoidal open-loop commands, as the thesis measured them (6.3.1)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.core.plant.simulation import initial_state, run_batch
from shake_ros.core.quantities import ShakeError

LONGEST_WINDOW = 20.0  # of a stretch of whole periods [s]


@dataclass(frozen=True)
class HarmonicRun:
    """One measured run: command amplitude [-], frequency [Hz], {order: acceleration amplitude [m/s²]}.

    Raises
    ------
    ShakeError : a number that is not finite or not positive, an amplitude above 1, no fundamental.
    """

    amplitude: float
    frequency: float
    harmonics: Mapping[int, float]

    def __post_init__(self) -> None:
        _check("amplitude", self.amplitude, 1.0)
        _check("frequency", self.frequency)
        if not isinstance(self.harmonics, Mapping) or 1 not in self.harmonics:
            raise ShakeError("harmonics: the fundamental, order 1, is missing")
        for order, amplitude in self.harmonics.items():
            if isinstance(order, bool) or not isinstance(order, int) or order < 1:
                raise ShakeError(f"harmonics: order {order!r} is not a whole number from 1 on")
            _check(f"harmonics: order {order}", amplitude)

    @property
    def orders(self) -> np.ndarray:
        """Measured orders, ascending."""
        return np.array(sorted(self.harmonics))

    @property
    def measured(self) -> np.ndarray:
        """Measured amplitudes in the order of `orders` [m/s²]."""
        return np.array([self.harmonics[k] for k in self.orders])


def _check(name: str, value: object, high: float = math.inf) -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and math.isfinite(value) and 0.0 < value <= high):  # type: ignore[arg-type, operator]
        raise ShakeError(f"{name} = {value!r} is not a positive number{f' up to {high:g}' if high < math.inf else ''}")


def whole_periods(frequency: float, sample_time: float, window: float) -> int:
    """Samples of the shortest stretch of whole periods that is a whole number of samples and at least `window` [s].

    Raises
    ------
    ShakeError : where no such stretch is shorter than LONGEST_WINDOW.

    >>> whole_periods(5.0, 1e-3, 0.5)
    600
    """
    first = max(1, math.ceil(window * frequency - 1e-9))
    for periods in range(first, max(first, math.floor(LONGEST_WINDOW * frequency)) + 1):
        samples = periods / (frequency * sample_time)
        if abs(samples - round(samples)) < 1e-6:
            return round(samples)
    raise ShakeError(
        f"frequency = {frequency:g} Hz: no number of whole periods within {LONGEST_WINDOW:g} s is a whole number of "
        f"samples of {sample_time:g} s"
    )


def sine_command(run: HarmonicRun, sample_time: float, length: int) -> np.ndarray:
    """u = A cos(2πft): starts at full speed, so that the table swings about where it stood; shape (length,)."""
    time = np.arange(length) * sample_time
    return np.asarray(run.amplitude * np.cos(2.0 * np.pi * run.frequency * time))


def amplitudes(acceleration: np.ndarray, sample_time: float, frequency: float, orders: np.ndarray) -> np.ndarray:
    """Amplitudes at multiples of `frequency` over whole periods.

    Parameters
    ----------
    acceleration : shape (..., n), n samples being whole periods. orders : shape (k,).

    Returns
    -------
    shape (..., k), in the unit of the input.
    """
    n = acceleration.shape[-1]
    time = np.arange(n) * sample_time
    basis = np.exp(-2j * np.pi * frequency * np.outer(time, orders))
    return np.asarray(2.0 / n * np.abs(acceleration @ basis))


class HarmonicProblem:
    """Residuals between simulated and measured harmonic amplitudes [m/s²], unweighted.

    Parameters
    ----------
    runs : the measured runs. sample_time, settle [s]. window : least length of the whole periods looked at [s].
    """

    def __init__(
        self, runs: Sequence[HarmonicRun], sample_time: float = 1e-3, settle: float = 0.5, window: float = 0.5
    ) -> None:
        self.runs = list(runs)
        self.sample_time = sample_time
        self._times = (sample_time, settle, window)
        self._settled = [whole_periods(r.frequency, sample_time, settle) for r in self.runs]
        self._commands = [
            sine_command(r, sample_time, first + whole_periods(r.frequency, sample_time, window))
            for r, first in zip(self.runs, self._settled, strict=True)
        ]
        for run in self.runs:
            if run.orders[-1] * run.frequency * sample_time >= 0.5:
                raise ShakeError(
                    f"frequency = {run.frequency:g} Hz: order {run.orders[-1]} is not below half the sampling rate, "
                    f"{0.5 / sample_time:g} Hz"
                )
        self.measured = np.concatenate([r.measured for r in self.runs])

    @property
    def spans(self) -> list[slice]:
        """Where each run's amplitudes stand among `measured`."""
        ends = np.cumsum([len(r.orders) for r in self.runs]).tolist()
        return [slice(end - len(r.orders), end) for r, end in zip(self.runs, ends, strict=True)]

    def part(self, indices: Sequence[int]) -> HarmonicProblem:
        """The same problem with some of the runs only."""
        return HarmonicProblem([self.runs[i] for i in indices], *self._times)

    def steady(self, vectors: np.ndarray, index: int) -> np.ndarray:
        """Acceleration of run `index` over its whole periods for rows of parameters, shape (m, samples) [m/s²].

        At the first of these samples the command is at its peak.
        """
        starts = np.array([initial_state(v) for v in vectors])
        out = run_batch(vectors, starts, self._commands[index], self.sample_time, columns=(2,))
        return np.ascontiguousarray(out[:, self._settled[index] :, 0])

    def simulated(self, vectors: np.ndarray) -> np.ndarray:
        """Amplitudes of all runs for rows of parameters, shape (m, number of measured amplitudes) [m/s²]."""
        parts = [
            amplitudes(self.steady(vectors, i), self.sample_time, run.frequency, run.orders)
            for i, run in enumerate(self.runs)
        ]
        return np.concatenate(parts, axis=1)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Simulated minus measured amplitudes [m/s²]."""
        return self.simulated(vectors) - self.measured
