"""Harmonic amplitudes of the acceleration under sinusoidal open-loop commands, as the thesis measured them (6.3.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.plant.simulation import initial_state, run_batch


@dataclass(frozen=True)
class HarmonicRun:
    """One measured run: command amplitude [-], frequency [Hz], {order: acceleration amplitude [m/s²]}."""

    amplitude: float
    frequency: float
    harmonics: dict[int, float]

    @property
    def orders(self) -> np.ndarray:
        """Measured orders, ascending."""
        return np.array(sorted(self.harmonics))

    @property
    def measured(self) -> np.ndarray:
        """Measured amplitudes in the order of `orders` [m/s²]."""
        return np.array([self.harmonics[k] for k in self.orders])


def sine_command(run: HarmonicRun, sample_time: float, settle: float, window: float) -> np.ndarray:
    """u = A cos(2πft): starts at full speed, so that the table swings about where it stood."""
    time = np.arange(round((settle + window) / sample_time)) * sample_time
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
    runs : the measured runs. sample_time, settle, window : [s]; the window must hold whole periods of every run.
    """

    def __init__(
        self, runs: list[HarmonicRun], sample_time: float = 1e-3, settle: float = 0.5, window: float = 0.5
    ) -> None:
        self.runs = runs
        self.sample_time = sample_time
        self._settled = round(settle / sample_time)
        self._commands = [sine_command(r, sample_time, settle, window) for r in runs]
        self.measured = np.concatenate([r.measured for r in runs])

    def simulated(self, vectors: np.ndarray) -> np.ndarray:
        """Amplitudes of all runs for rows of parameters, shape (m, number of measured amplitudes) [m/s²]."""
        starts = np.array([initial_state(v) for v in vectors])
        parts = []
        for run, command in zip(self.runs, self._commands, strict=True):
            out = run_batch(vectors, starts, command, self.sample_time, columns=(2,))
            steady = out[:, self._settled :, 0]
            parts.append(amplitudes(steady, self.sample_time, run.frequency, run.orders))
        return np.concatenate(parts, axis=1)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Simulated minus measured amplitudes [m/s²]."""
        return self.simulated(vectors) - self.measured
