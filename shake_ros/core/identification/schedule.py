"""The thesis's neural schedule of the parameters (6.3.5): amplitude and frequency of the command → θ_1 … θ_7.

A short-time Fourier transform over the last two seconds of the command gives its dominant line; a network of two hidden
layers maps that to the parameters, which the simulation then takes. Trained with Levenberg–Marquardt (4.12) on
parameters that were fitted window by window, 80 % to learn, 10 % to stop by, 10 % to test. The schedule is blind to
what happened within its window: after a change it takes up to two seconds to see it. Source: thesis 6.3.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.core.compiled import njit
from shake_ros.core.identification.fit import Problem, fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recordings import Record, RecordingProblem
from shake_ros.core.plant.dormand_prince import STAGE, workspace
from shake_ros.core.plant.integration import OUTPUTS, acceleration_now, advance_sample, delayed, outputs
from shake_ros.core.plant.parameters import records
from shake_ros.core.plant.simulation import TOLERANCE, initial_state
from shake_ros.core.plant.states import LAGGED_POSITION, POSITION, VELOCITY
from shake_ros.core.quantities import ShakeError

WINDOW = 2.0  # length of the transform's window [s]
HOP = 0.1  # from one window to the next [s]
HIDDEN = (6, 6)  # neurons of the two hidden layers
EPOCHS, GOAL = 1000, 1e-6  # of the training (6.3.5)
PATIENCE = 6  # epochs in which the part to stop by does not improve, after which the training ends
DAMPING, TENFOLD, HEAVIEST = 1e-2, 10.0, 1e10  # first damping μ of (4.12), its factor, and where it gives up
WIDTH = 2.0  # deviation, in sizes of a parameter, that a window may have from the fit to all: the prior of its fit


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


@dataclass(frozen=True)
class Network:
    """Two hidden layers with tanh, a linear output; weights of shape (n,), scaling of inputs and outputs."""

    weights: np.ndarray
    input_mean: np.ndarray
    input_spread: np.ndarray
    output_mean: np.ndarray
    output_spread: np.ndarray

    @staticmethod
    def size(outputs: int) -> int:
        """Number of weights."""
        a, b = HIDDEN
        return 2 * a + a + a * b + b + b * outputs + outputs

    def with_weights(self, weights: np.ndarray) -> Network:
        """The same scaling with other weights."""
        return Network(weights, self.input_mean, self.input_spread, self.output_mean, self.output_spread)

    def layers(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Matrix and bias of each layer."""
        found, first, rows = [], 0, len(self.input_mean)
        for width in (*HIDDEN, len(self.output_mean)):
            last = first + rows * width
            found.append((self.weights[first:last].reshape(rows, width), self.weights[last : last + width]))
            first, rows = last + width, width
        return found

    def scaled(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs in spreads about their mean for rows of inputs, shape (m, 2) → (m, outputs)."""
        (w_1, b_1), (w_2, b_2), (w_3, b_3) = self.layers()
        x = (np.atleast_2d(inputs) - self.input_mean) / self.input_spread
        return np.asarray(np.tanh(np.tanh(x @ w_1 + b_1) @ w_2 + b_2) @ w_3 + b_3)

    def derivative(self, inputs: np.ndarray) -> np.ndarray:
        """Of `scaled` by the weights, shape (m · outputs, n)."""
        (w_1, b_1), (w_2, b_2), (w_3, _) = self.layers()
        x = (np.atleast_2d(inputs) - self.input_mean) / self.input_spread
        z_1 = np.tanh(x @ w_1 + b_1)
        z_2 = np.tanh(z_1 @ w_2 + b_2)
        m, last = len(x), w_3.shape[1]
        d_2 = w_3.T[None] * (1.0 - z_2**2)[:, None, :]  # (m, outputs, second layer)
        d_1 = (d_2 @ w_2.T) * (1.0 - z_1**2)[:, None, :]
        own = np.eye(last)[None]
        parts = (
            x[:, None, :, None] * d_1[:, :, None, :],
            d_1,
            z_1[:, None, :, None] * d_2[:, :, None, :],
            d_2,
            z_2[:, None, :, None] * own[:, :, None, :],
            np.broadcast_to(own, (m, last, last)),
        )
        return np.concatenate([p.reshape(m * last, -1) for p in parts], axis=1)

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs for rows of inputs, shape (m, 2) → (m, outputs)."""
        return np.asarray(self.output_mean + self.output_spread * self.scaled(inputs))


@dataclass(frozen=True)
class Training:
    """A trained network; mean squares of the scaled outputs' error on the parts to learn, stop by and test; epochs."""

    network: Network
    learn: float
    stop: float
    test: float
    epochs: int


def train(inputs: np.ndarray, outputs: np.ndarray, seed: int = 0) -> Training:
    """Train a network with Levenberg–Marquardt.

    Parameters
    ----------
    inputs : amplitude and frequency, shape (m, 2). outputs : parameters, shape (m, p).
    seed : of the split and of the first weights.

    Raises
    ------
    ShakeError : too few samples for the weights.
    """
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(inputs))
    tenth = max(len(inputs) // 10, 1)
    test, stop, learn = order[:tenth], order[tenth : 2 * tenth], order[2 * tenth :]
    count = Network.size(outputs.shape[1])
    if len(learn) * outputs.shape[1] < count:
        needed = -(-count // outputs.shape[1]) + 2 * tenth
        raise ShakeError(f"{len(inputs)} windows of {WINDOW:g} s are too few to train {count} weights: {needed} needed")
    spread = [np.maximum(np.std(v[learn], axis=0), 1e-9) for v in (inputs, outputs)]
    means = [np.mean(v[learn], axis=0) for v in (inputs, outputs)]
    network = Network(0.5 * rng.standard_normal(count), means[0], spread[0], means[1], spread[1])
    wanted = (outputs - means[1]) / spread[1]

    def error(candidate: Network, part: np.ndarray) -> np.ndarray:
        return np.asarray((candidate.scaled(inputs[part]) - wanted[part]).ravel())

    def mean_square(candidate: Network, part: np.ndarray) -> float:
        return float(np.mean(error(candidate, part) ** 2))

    best, waited, epochs, damping = network, 0, 0, DAMPING
    while epochs < EPOCHS and waited < PATIENCE and damping < HEAVIEST and mean_square(network, learn) > GOAL:
        r, j = error(network, learn), network.derivative(inputs[learn])
        step = np.linalg.solve(j.T @ j + damping * np.eye(count), -j.T @ r)
        moved = network.with_weights(network.weights + step)
        if mean_square(moved, learn) >= float(np.mean(r**2)):
            damping *= TENFOLD
            continue
        network, damping, epochs, waited = moved, damping / TENFOLD, epochs + 1, waited + 1
        if mean_square(network, stop) < mean_square(best, stop):
            best, waited = network, 0
    squares = [mean_square(best, part) for part in (learn, stop, test)]
    return Training(best, squares[0], squares[1], squares[2], epochs)


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
            span = slice(first, first + n)
            acceleration = None if r.acceleration is None else r.acceleration[span]
            standing = float(r.commands[first - 1]) if first else r.standing
            found.append(
                Record(r.name, r.sample_time, r.commands[span], r.position[span], acceleration, standing=standing)
            )
    return found


def window_fits(windows: Sequence[Record], free: FreeParameters, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and frequency, shape (m, 2), and fitted parameters, shape (m, p), of each window; x : fit to all."""
    inputs = np.array([dominant(w.commands, w.sample_time) for w in windows])
    fitted = [fit(NearTo(RecordingProblem([w]), free, x), free, x, evaluations=5, tolerance=1e-3).x for w in windows]
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
def _simulate(rows, acting, commands, standing, track, y0, dt, tolerance, out):
    """As plant/integration.py:simulate, with the parameters of rows[acting[i]] during sample i."""
    y = y0.copy()
    work = workspace()
    acceleration = acceleration_now(rows[acting[0]], y, work[STAGE])
    for i in range(commands.shape[0]):
        p = rows[acting[i]]
        shift = track[i] - y[POSITION]
        y[POSITION] = track[i]
        y[LAGGED_POSITION] += shift
        outputs(p, y, acceleration, out[i])
        late, timely, fraction = delayed(commands, i, p.command_delay_delay / dt, standing)
        acceleration = advance_sample(p, y, late, timely, fraction, 0.0, dt, work, False, tolerance)


def run_scheduled(network: Network, free: FreeParameters, record: Record) -> np.ndarray:
    """Free run of the scheduled table over a recording, columns as plant/simulation.py:COLUMNS, shape (n, 7)."""
    rows, acting = schedule_of(network, free, record)
    vectors = free.vectors(rows)
    y0 = initial_state(vectors[0], float(record.track[0]))
    y0[VELOCITY] = record.velocity[0]
    out = np.empty((len(record.commands), OUTPUTS))
    commands = np.ascontiguousarray(record.commands, dtype=float)
    _simulate(records(vectors), acting, commands, record.standing, record.track, y0, record.sample_time, TOLERANCE, out)
    return out
