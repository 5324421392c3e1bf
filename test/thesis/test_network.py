"""The network of 6.3.5 and its training by Levenberg–Marquardt, and the radial-basis network beside it."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.thesis import network as of_network
from shake_ros.thesis.network import HIDDEN, Split, first_network, radial_basis, train

SMALL = (6, 6)
DRAW = np.random.default_rng(3)
INPUTS = DRAW.uniform(0.0, 1.0, (80, 2))
OUTPUTS = np.column_stack([np.sin(2.0 * INPUTS[:, 0]) + INPUTS[:, 1], INPUTS[:, 0] * INPUTS[:, 1]])


def test_the_network_is_that_of_the_text() -> None:
    """Two hidden layers of 100 sigmoid neurons, amplitude and frequency in, seven parameters out."""
    assert HIDDEN == (100, 100)
    made = first_network(INPUTS, np.tile(OUTPUTS[:, :1], 7), 1)
    assert [matrix.shape for matrix, _ in made.layers()] == [(2, 100), (100, 100), (100, 7)]
    hidden = INPUTS
    for matrix, bias in made.layers()[:2]:
        scaled = (hidden - INPUTS.mean(0)) / INPUTS.std(0) if hidden is INPUTS else hidden
        hidden = 1.0 / (1.0 + np.exp(-(scaled @ matrix + bias)))
    matrix, bias = made.layers()[2]
    np.testing.assert_allclose(made.scaled(INPUTS), hidden @ matrix + bias, rtol=1e-9)


def test_the_derivative_is_that_of_differences() -> None:
    net, x = first_network(INPUTS, OUTPUTS, 2, SMALL), INPUTS[:5]
    step = 1e-6 * np.eye(len(net.weights))
    moved = [(net.with_weights(net.weights + s).scaled(x) - net.scaled(x)).ravel() / 1e-6 for s in step]
    assert net.derivative(x) == pytest.approx(np.array(moved).T, abs=1e-4)


def test_a_step_is_that_of_the_normal_equations(monkeypatch: pytest.MonkeyPatch) -> None:
    """(J'J + μ I)⁻¹ J'r of (4.12), written with the weights as unknowns."""
    monkeypatch.setattr(of_network, "EPOCHS", 1)
    done = train(INPUTS, OUTPUTS, seed=4, hidden=SMALL)
    learn = done.split.learn
    first = first_network(INPUTS[learn], OUTPUTS[learn], 4, SMALL)
    wanted = (OUTPUTS[learn] - first.output_mean) / first.output_spread
    j, r = first.derivative(INPUTS[learn]), (first.scaled(INPUTS[learn]) - wanted).ravel()
    for damping in 1e-2 * 10.0 ** np.arange(6):
        moved = first.with_weights(
            first.weights - np.linalg.solve(j.T @ j + damping * np.eye(len(first.weights)), j.T @ r)
        )
        cost = float(np.mean((moved.scaled(INPUTS[learn]) - wanted) ** 2))
        if cost < done.curves[0, 0]:
            break
    assert done.curves[1, 0] == pytest.approx(cost, rel=1e-6)


def test_training_learns_a_smooth_map_and_gives_the_same_network_again() -> None:
    first, second = (train(INPUTS, OUTPUTS, seed=4, hidden=SMALL) for _ in range(2))
    assert first.test < 0.05
    assert first.stop == first.curves[:, 1].min()
    assert np.array_equal(first.network.weights, second.network.weights)
    assert radial_basis(INPUTS, OUTPUTS, first.split) < 0.05


def test_radial_basis_of_outputs_without_a_law_is_no_better_than_the_mean() -> None:
    noise = np.random.default_rng(1).standard_normal((80, 2))
    assert radial_basis(INPUTS, noise, Split.drawn(80, 1)) > 0.6


def test_a_split_is_of_80_10_and_10_percent_and_takes_every_sample_once() -> None:
    split = Split.drawn(80, 1)
    assert [len(part) for part in (split.learn, split.stop, split.test)] == [64, 8, 8]
    assert sorted(np.concatenate([split.learn, split.stop, split.test])) == list(range(80))


def test_too_few_windows_are_refused_with_the_number_needed() -> None:
    with pytest.raises(ShakeError, match="too few to learn from"):
        train(np.zeros((4, 2)), np.zeros((4, 7)))


def test_the_full_network_learns_a_smooth_map(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(of_network, "EPOCHS", 6)
    assert train(INPUTS, OUTPUTS, seed=1).learn < 0.1
