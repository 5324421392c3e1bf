"""The thesis's neural schedule of the parameters (6.3.5): amplitude and frequency of the command → θ_1 … θ_7.

A short-time Fourier transform over the last two seconds of the command gives its dominant line; a network of two
hidden layers (`network`) maps that to the parameters, which the simulation then takes. It learns from parameters that
were fitted window by window. The schedule is blind to what happened within its window: after a change it takes up to
two seconds to see it. Source: thesis 6.3.5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.core.compiled import njit
from shake_ros.core.identification.fit import Problem, fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.dormand_prince import STAGE, workspace
from shake_ros.core.plant.integration import OUTPUTS, acceleration_now, advance_sample, delayed, follow, outputs
from shake_ros.core.plant.parameters import records
from shake_ros.core.plant.simulation import SMOOTH, initial_state
from shake_ros.core.plant.states import VELOCITY
from shake_ros.thesis.network import Network

WINDOW = 2.0  # length of the transform's window [s]
HOP = 0.1  # from one window to the next [s]
WIDTH = 0.5  # deviation, in sizes of a parameter, that a window may have from the fit to all: the prior of its fit
EVALUATIONS = 15  # most trial points of the fit to a window


def dominant(commands: np.ndarray, sample_time: float) -> tuple[float, float]:
    """Amplitude [-] and frequency [Hz] of the largest line of a window, Hann-weighted, between the bins by a parabola.

    >>> u = 0.3 * np.sin(2.0 * np.pi * 2.2 * np.arange(2000) * 1e-3)
    >>> [round(float(value), 2) for value in dominant(u, 1e-3)]
    [0.3, 2.2]
    """
    n = len(commands)
    window = np.hanning(n)
    lines = np.abs(np.fft.rfft(window * (commands - np.mean(commands)), 4 * n))
    k = int(np.argmax(lines[1:-1])) + 1
    left, middle, right = lines[k - 1 : k + 2]
    bend = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    peak = middle - 0.25 * (left - right) * shift
    return 2.0 * float(peak) / float(window.sum()), (k + float(shift)) / (4.0 * n * sample_time)


class NearTo:
    """A problem with a prior: parameters stay near to given ones unless the residuals say otherwise."""

    def __init__(self, problem: Problem, free: FreeParameters, x: np.ndarray) -> None:
        self._problem, self._columns, self._scale = problem, free.columns, free.scale
        self._x, self._width = x, WIDTH * np.maximum(np.abs(x), 1.0)

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        """Those of the problem, then one per parameter."""
        away = (vectors[:, self._columns] / self._scale - self._x) / self._width
        return np.concatenate([self._problem.residuals(vectors), away], axis=1)


def pieces(recordings: Sequence[Record]) -> list[Record]:
    """The recordings cut into windows without overlap, the rest left out."""
    found = []
    for r in recordings:
        n = round(WINDOW / r.sample_time)
        for first in range(0, len(r.commands) - n + 1, n):
            found.append(r.part(slice(first, first + n)))
    return found


def window_fits(windows: Sequence[Record], free: FreeParameters, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and frequency, shape (m, 2), and fitted parameters, shape (m, p), of each window; x : fit to all."""
    inputs = np.array([dominant(w.commands, w.sample_time) for w in windows])
    fitted = [
        fit(NearTo(RecordingProblem([w]), free, x), free, x, evaluations=EVALUATIONS, tolerance=1e-3).x for w in windows
    ]
    return inputs, np.array(fitted)


def schedule_of(network: Network, free: FreeParameters, record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Parameters over a recording, shape (k, p), and which of them acts at each sample, shape (n,).

    The first row is the mean of the training, which acts until the first window is full.
    """
    n, hop = round(WINDOW / record.sample_time), max(round(HOP / record.sample_time), 1)
    ends = range(n, len(record.commands) + 1, hop)
    seen = [dominant(record.commands[end - n : end], record.sample_time) for end in ends]
    rows = (
        np.concatenate([network.output_mean[None, :], network(np.array(seen))]) if seen else network.output_mean[None]
    )
    acting = np.clip((np.arange(len(record.commands)) - n) // hop + 1, 0, len(rows) - 1)
    return np.clip(rows, free.low, free.high), acting


@njit
def _simulate(rows, acting, commands, command_before, track, y0, dt, tolerance, out):
    """As plant/integration.py:simulate, with the parameters of rows[acting[i]] during sample i."""
    y = y0.copy()
    work = workspace()
    acceleration = acceleration_now(rows[acting[0]], y, work[STAGE])
    for i in range(commands.shape[0]):
        p = rows[acting[i]]
        follow(p, y, track[i])
        outputs(p, y, acceleration, out[i])
        late, timely, fraction = delayed(commands, i, p.command_delay_delay / dt, command_before)
        acceleration = advance_sample(p, y, late, timely, fraction, 0.0, dt, work, False, tolerance)


def run_scheduled(network: Network, free: FreeParameters, record: Record) -> np.ndarray:
    """Free run of the scheduled table over a recording, columns as plant/simulation.py:COLUMNS, shape (n, 7)."""
    rows, acting = schedule_of(network, free, record)
    vectors = free.vectors(rows)
    y0 = initial_state(vectors[0], float(record.track[0]))
    y0[VELOCITY] = record.velocity[0]
    out = np.empty((len(record.commands), OUTPUTS))
    commands = np.ascontiguousarray(record.commands, dtype=float)
    _simulate(
        records(vectors), acting, commands, record.command_before, record.track, y0, record.sample_time, SMOOTH, out
    )
    return out
