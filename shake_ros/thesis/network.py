"""The neural schedule of the parameters (6.3.5): amplitude and frequency of the command → θ_1 … θ_7.

A short-time Fourier transform over the last two seconds of the command gives its dominant line; a network with two
hidden layers of sigmoid neurons maps that to the parameters, which the simulation then takes. It learns from parameters
that were fitted window by window. The schedule is blind to what happened within its window: after a change it takes up
to two seconds to see it.

The thesis's network (6.3.5) has 100 neurons in each layer, so some 1e4 weights on a few hundred errors. The step of
(4.12), (J'J + μ I)⁻¹ J'r, is taken as J'(J J' + μ I)⁻¹ r, which is the same and solves for the errors instead of the
weights: no other library is needed for it. Training stops after 1000 epochs or at a mean square of 1e-6, as printed, or
where the part to stop by has not improved for 30 epochs, where the print waits for 1000; kept are the weights that were
best on that part. Beside it: a radial-basis network.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator

from shake_ros.compiled import njit
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Problem, fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.dormand_prince import STAGE, workspace
from shake_ros.physics.plant.integration import OUTPUTS, acceleration_now, advance_sample, delayed, follow, outputs
from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.simulation import SMOOTH, initial_state
from shake_ros.physics.plant.states import VELOCITY
from shake_ros.quantities import ShakeError

HIDDEN = (100, 100)  # neurons of the two hidden layers
EPOCHS, GOAL, PATIENCE = 1000, 1e-6, 30  # of the training (6.3.5)
DAMPING, TENFOLD, HEAVIEST = 1e-2, 10.0, 1e10  # first damping μ of (4.12), its factor, and where it gives up
SMOOTHING = 1.0  # of the radial-basis network: a ridge as strong as one sample


def sigmoid(x: np.ndarray) -> np.ndarray:
    """1/(1 + exp(−x)), shape as x."""
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * x)))


@dataclass(frozen=True)
class Network:
    """Two hidden layers of sigmoid neurons, a linear output; weights of shape (n,), scaling of inputs and outputs."""

    weights: np.ndarray
    input_mean: np.ndarray
    input_spread: np.ndarray
    output_mean: np.ndarray
    output_spread: np.ndarray
    hidden: tuple[int, int] = HIDDEN

    @staticmethod
    def size(outputs: int, hidden: tuple[int, int] = HIDDEN) -> int:
        """Number of weights."""
        a, b = hidden
        return 2 * a + a + a * b + b + b * outputs + outputs

    def with_weights(self, weights: np.ndarray) -> Network:
        """The same scaling with other weights."""
        scaling = self.input_mean, self.input_spread, self.output_mean, self.output_spread
        return Network(weights, *scaling, self.hidden)

    def layers(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Matrix and bias of each layer."""
        found, first, rows = [], 0, len(self.input_mean)
        for width in (*self.hidden, len(self.output_mean)):
            last = first + rows * width
            found.append((self.weights[first:last].reshape(rows, width), self.weights[last : last + width]))
            first, rows = last + width, width
        return found

    def scaled(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs in spreads about their mean for rows of inputs, shape (m, 2) → (m, outputs)."""
        (w_1, b_1), (w_2, b_2), (w_3, b_3) = self.layers()
        x = (np.atleast_2d(inputs) - self.input_mean) / self.input_spread
        return np.asarray(sigmoid(sigmoid(x @ w_1 + b_1) @ w_2 + b_2) @ w_3 + b_3)

    def derivative(self, inputs: np.ndarray) -> np.ndarray:
        """Of `scaled` by the weights, shape (m · outputs, n)."""
        (w_1, b_1), (w_2, b_2), (w_3, _) = self.layers()
        x = (np.atleast_2d(inputs) - self.input_mean) / self.input_spread
        z_1 = sigmoid(x @ w_1 + b_1)
        z_2 = sigmoid(z_1 @ w_2 + b_2)
        m, last = len(x), w_3.shape[1]
        d_2 = w_3.T[None] * (z_2 * (1.0 - z_2))[:, None, :]  # (m, outputs, second layer)
        d_1 = (d_2 @ w_2.T) * (z_1 * (1.0 - z_1))[:, None, :]
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
class Split:
    """Numbers of the samples to learn from, to stop by and to test on: 80, 10 and 10 % (6.3.5)."""

    learn: np.ndarray
    stop: np.ndarray
    test: np.ndarray

    @classmethod
    def drawn(cls, count: int, seed: int) -> Split:
        """A random split; ShakeError where there are too few samples for three parts."""
        if count < 5:
            raise ShakeError(f"{count} windows are too few to learn from, to stop by and to test on: 5 needed")
        order = np.random.default_rng(seed).permutation(count)
        tenth = max(count // 10, 1)
        return cls(order[2 * tenth :], order[tenth : 2 * tenth], order[:tenth])


@dataclass(frozen=True)
class Training:
    """A trained network."""

    network: Network
    split: Split  # of the samples
    # mean squares of the scaled outputs' error on the parts to learn from, to stop by and to test on after every epoch,
    # shape (epochs + 1, 3)
    curves: np.ndarray
    kept: int  # epoch of the weights

    @property
    def epochs(self) -> int:
        """Of the whole training."""
        return len(self.curves) - 1

    @property
    def learn(self) -> float:
        """Mean square of the scaled error on the part to learn from."""
        return float(self.curves[self.kept, 0])

    @property
    def stop(self) -> float:
        """The same on the part to stop by."""
        return float(self.curves[self.kept, 1])

    @property
    def test(self) -> float:
        """The same on the part to test on; predicting the mean gives about 1."""
        return float(self.curves[self.kept, 2])


def first_network(inputs: np.ndarray, outputs: np.ndarray, seed: int, hidden: tuple[int, int] = HIDDEN) -> Network:
    """A network before its training, scaled to the samples that it will learn from, its weights drawn."""
    rng, widths = np.random.default_rng([seed, 1]), (inputs.shape[1], *hidden, outputs.shape[1])
    drawn = []
    for rows, columns in zip(widths, widths[1:], strict=False):
        drawn += [rng.standard_normal(rows * columns) / np.sqrt(rows), rng.standard_normal(columns)]
    means = [np.mean(data, axis=0) for data in (inputs, outputs)]
    spreads = [np.maximum(np.std(data, axis=0), 1e-9) for data in (inputs, outputs)]
    return Network(np.concatenate(drawn), means[0], spreads[0], means[1], spreads[1], hidden)


def train(inputs: np.ndarray, outputs: np.ndarray, seed: int = 0, hidden: tuple[int, int] = HIDDEN) -> Training:
    """Train a network with Levenberg–Marquardt.

    Parameters
    ----------
    inputs : amplitude and frequency, shape (m, 2). outputs : parameters, shape (m, p).
    seed : of the split and of the first weights. hidden : neurons of the two layers.

    Raises
    ------
    ShakeError : too few samples to split.
    """
    split = Split.drawn(len(inputs), seed)
    parts = split.learn, split.stop, split.test
    network = first_network(inputs[split.learn], outputs[split.learn], seed, hidden)
    wanted = (outputs - network.output_mean) / network.output_spread

    def squares(candidate: Network) -> tuple[float, ...]:
        error = candidate.scaled(inputs) - wanted
        return tuple(float(np.mean(error[part] ** 2)) for part in parts)

    curves, best, kept, damping = [squares(network)], network, 0, DAMPING
    while len(curves) <= EPOCHS and len(curves) - 1 - kept < PATIENCE and curves[-1][0] > GOAL:
        error = (network.scaled(inputs[split.learn]) - wanted[split.learn]).ravel()
        jacobian = network.derivative(inputs[split.learn])
        gram = jacobian @ jacobian.T
        while damping < HEAVIEST:
            step = jacobian.T @ np.linalg.solve(gram + damping * np.eye(len(error)), error)  # (4.12)
            moved = network.with_weights(network.weights - step)
            found = squares(moved)
            if found[0] < curves[-1][0]:
                break
            damping *= TENFOLD
        else:
            break
        network, damping = moved, damping / TENFOLD
        curves.append(found)
        if found[1] < curves[kept][1]:
            best, kept = network, len(curves) - 1
    return Training(best, split, np.array(curves), kept)


def radial_basis(inputs: np.ndarray, outputs: np.ndarray, split: Split) -> float:
    """Mean square of the scaled error on the test part of a network of thin plates on every sample learnt from.

    scipy's `RBFInterpolator` with a ridge; the error is in the spreads of the part learnt from, as in `Training`.
    """
    means, spreads = (f(inputs[split.learn], axis=0) for f in (np.mean, np.std))
    x = (inputs - means) / np.maximum(spreads, 1e-9)
    mean, spread = np.mean(outputs[split.learn], axis=0), np.maximum(np.std(outputs[split.learn], axis=0), 1e-9)
    y = (outputs - mean) / spread
    found = RBFInterpolator(x[split.learn], y[split.learn], smoothing=SMOOTHING)(x[split.test])
    return float(np.mean((found - y[split.test]) ** 2))


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


@dataclass(frozen=True)
class SeedResult:
    """A network of one seed, on the windows that it has not seen."""

    seed: int  # of split and weights
    training: Training  # with its curves
    # mean square of the scaled error on the test part of a radial-basis network, beside `training.test`
    radial_basis: float
    # mean relative error of the free run over the windows to test on, of velocity and acceleration, by what gives the
    # parameters: "one set", "network", "fit to the window", the least that any schedule could have
    errors: Mapping[str, tuple[float, float]]

    @property
    def figures(self) -> dict[str, float]:
        """Of the training, by name: mean squares of the scaled error of θ, where the mean gives 1 [-]."""
        t = self.training
        errors = {"learn": t.learn, "stop": t.stop, "test": t.test, "radial_basis": self.radial_basis}
        return {"seed": self.seed, "epochs": t.epochs, "kept": t.kept, **errors}


def window_errors(windows: Sequence[Record], free: FreeParameters, rows: np.ndarray) -> tuple[float, float]:
    """Mean relative error of velocity and acceleration over windows, each with its row of parameters."""
    found = []
    for window, vector in zip(windows, free.vectors(np.clip(rows, free.low, free.high)), strict=True):
        error = RecordingProblem([window]).errors(vector)[window.name]
        found.append((error["velocity"], error.get("acceleration", np.nan)))
    velocity, acceleration = np.mean(found, axis=0)
    return float(velocity), float(acceleration)


def trained(
    seed: int, windows: Sequence[Record], free: FreeParameters, one: np.ndarray, data: tuple[np.ndarray, np.ndarray]
) -> SeedResult:
    """Train on the windows' features and parameters, and run the test windows; one : the constant set."""
    training = train(*data, seed)
    test = training.split.test
    held = [windows[k] for k in test]
    rows = {
        "one set": np.tile(one, (len(test), 1)),
        "network": training.network(data[0][test]),
        "fit to the window": data[1][test],
    }
    errors = {name: window_errors(held, free, values) for name, values in rows.items()}
    return SeedResult(seed, training, radial_basis(*data, training.split), errors)


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
