"""What single parameters of (6.15) do to the table's motion and to the harmonics of its acceleration, thesis 6.3.4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import initial_state, run_batch

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ParameterStudy:
    """Simulations with one parameter changed.

    Attributes
    ----------
    name : of the parameter. values : shape (m,) in the unit of the thesis's θ. sample_time : [s].
    commands : shape (n,) [-]. motion : shape (m, n, 3): position [m], velocity [m/s], acceleration [m/s²].
    """

    name: str
    values: Floats
    sample_time: float
    commands: Floats
    motion: Floats

    def spectrum(self, samples: int) -> tuple[Floats, Floats]:
        """Frequencies [Hz], shape (k,), and amplitudes [m/s²], shape (m, k), of the last `samples` of acceleration."""
        last = self.motion[:, -samples:, 2]
        amplitude = 2.0 / samples * np.abs(np.fft.rfft(last, axis=1))
        return np.asarray(np.fft.rfftfreq(samples, self.sample_time), dtype=float), np.asarray(amplitude, dtype=float)

    def spread(self, samples: int) -> Floats:
        """How far the runs lie apart in position, velocity and acceleration, relative to their size, shape (3,) [-].

        The root mean square over the last `samples` of the difference between the runs with the least and the greatest
        value, over that of their mean; the drift of an open-loop position is left out.
        """
        last = self.motion[:, -samples:, :] - self.motion[:, -samples:, :].mean(axis=1, keepdims=True)
        low, high = last[int(np.argmin(self.values))], last[int(np.argmax(self.values))]
        return np.asarray(np.std(high - low, axis=0) / np.std(0.5 * (high + low), axis=0))


def study(
    table: TableParameters,
    name: str,
    values: Floats,
    settings: list[dict[str, float]],
    commands: Floats,
    sample_time: float,
) -> ParameterStudy:
    """Simulate the table with each of `settings` (dotted names to values), side by side.

    Parameters
    ----------
    name, values : what the settings stand for. commands : shape (n,) [-]. sample_time : [s].
    """
    vectors = np.array([table.with_values(changes).vector() for changes in settings])
    starts = np.array([initial_state(vector) for vector in vectors])
    motion = run_batch(vectors, starts, commands, sample_time, columns=(0, 1, 2))
    return ParameterStudy(name, np.asarray(values, dtype=float), sample_time, commands, motion)
