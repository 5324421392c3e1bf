"""The smoother of a latent force beside closed forms and least squares."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from shake_ros.explain.force_smoother import ForceDynamics, ForceSmoother, Residuals

DT = 1e-3
START = (0.01, 2.0, 3.0)
NOISE = (2e-3, 0.05)


def dynamics(n: int, dt: float = DT) -> ForceDynamics:
    """An oil column whose spring and relaxation change over the recording."""
    return ForceDynamics(0.6, np.linspace(3000.0, 5000.0, n), np.linspace(1.0, 9.0, n), dt)


def residuals(n: int) -> Residuals:
    """Noise and a wave, the velocity at every third sample, gaps in both."""
    rng = np.random.default_rng(3)
    velocity, acceleration = np.full(n, np.nan), np.sin(0.2 * np.arange(n)) + 0.05 * rng.standard_normal(n)
    velocity[::3] = 2e-3 * rng.standard_normal(len(velocity[::3]))
    acceleration[10:14] = np.nan
    return Residuals(velocity, acceleration, NOISE)


def least_squares(model: ForceDynamics, data: Residuals, intensity: float) -> tuple[np.ndarray, np.ndarray]:
    """States of the largest posterior density and the force's deviation, from the normal equations of all samples."""
    n = len(data.velocity)
    rows, right = [], []

    def add(entries: dict[int, float], value: float, deviation: float) -> None:
        row = np.zeros(3 + n - 1)  # the first state and the steps of the walk
        for place, entry in entries.items():
            row[place] = entry
        rows.append(row / deviation)
        right.append(value / deviation)

    for i, deviation in enumerate(START):
        add({i: 1.0}, 0.0, deviation)
    for k in range(n - 1):
        add({3 + k: 1.0}, 0.0, math.sqrt(intensity * model.sample_time))
    maps = np.zeros((n, 3, 3 + n - 1))
    maps[0, :, :3] = np.eye(3)
    for k in range(n - 1):
        a = np.array([[-model.viscous, 1.0, 1.0], [-model.spring[k], -model.relaxation[k], 0.0], [0.0, 0.0, 0.0]])
        pushed = maps[k].copy()
        pushed[2, 3 + k] += 1.0
        maps[k + 1] = expm(a * model.sample_time) @ pushed
    for k in range(n):
        for values, row, deviation in (
            (data.velocity, np.array([1.0, 0.0, 0.0]), NOISE[0]),
            (data.acceleration, np.array([-model.viscous, 1.0, 1.0]), NOISE[1]),
        ):
            if np.isfinite(values[k]):
                add(dict(enumerate(row @ maps[k])), float(values[k]), deviation)
    matrix = np.array(rows)
    solution = np.linalg.lstsq(matrix, np.array(right), rcond=None)[0]
    covariance = np.linalg.inv(matrix.T @ matrix)
    return maps @ solution, np.sqrt(np.einsum("ki,ij,kj->k", maps[:, 2], covariance, maps[:, 2]))


def test_smoothed_states_are_those_of_least_squares_over_all_samples() -> None:
    model, data = dynamics(60), residuals(60)
    result = ForceSmoother(model, data, START).smoothed(40.0)
    states, deviation = least_squares(model, data, 40.0)
    np.testing.assert_allclose(result.states, states, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(result.deviation, deviation, rtol=1e-6)


def test_slow_sampling_of_a_stiff_column_is_as_exact() -> None:
    model, data = dynamics(40, dt=0.02), residuals(40)
    result = ForceSmoother(model, data, START).smoothed(40.0)
    np.testing.assert_allclose(result.states, least_squares(model, data, 40.0)[0], rtol=1e-6, atol=1e-7)


def test_force_on_a_free_mass_is_weighted_as_the_walk_in_noise_asks() -> None:
    """ĝ_k = (1 − θ)/(1 + θ) Σ θ^|j| a_(k+j), θ + 1/θ = 2 + q/r, far from the ends of a walk in white noise."""
    n, intensity = 801, 30.0
    none = np.zeros(n)
    impulse = np.zeros(n)
    impulse[400] = 1.0
    data = Residuals(np.full(n, np.nan), impulse, NOISE)
    result = ForceSmoother(ForceDynamics(0.0, none, none, DT), data, (1e-9, 1e-9, 1.0)).smoothed(intensity)
    ratio = intensity * DT / NOISE[1] ** 2
    theta = 1.0 + 0.5 * ratio - math.sqrt(ratio + 0.25 * ratio**2)
    expected = (1.0 - theta) / (1.0 + theta) * theta ** np.abs(np.arange(n) - 400)
    np.testing.assert_allclose(result.states[300:501, 2], expected[300:501], atol=1e-7)


def test_intensity_of_a_walk_is_found() -> None:
    rng = np.random.default_rng(8)
    n, true = 6000, 5.0
    none = np.zeros(n)
    walk = np.cumsum(math.sqrt(true * DT) * rng.standard_normal(n))
    data = Residuals(np.full(n, np.nan), walk + NOISE[1] * rng.standard_normal(n), NOISE)
    smoother = ForceSmoother(ForceDynamics(0.0, none, none, DT), data, (1e-9, 1e-9, 1.0))
    assert smoother.most_likely() == pytest.approx(true, rel=0.25)


def test_response_to_a_held_force_is_that_of_the_matrix_exponential() -> None:
    model = dynamics(200)
    force = np.where(np.arange(200) < 100, 1.5, 0.0)
    velocity, acceleration = model.response(force)
    state = np.zeros(2)
    for k in range(120):
        assert velocity[k] == pytest.approx(state[0], abs=1e-12)
        before = force[k - 1] if k else 0.0
        assert acceleration[k] == pytest.approx(-model.viscous * state[0] + state[1] + before, abs=1e-9)
        a = np.array([[-model.viscous, 1.0, 1.0], [-model.spring[k], -model.relaxation[k], 0.0], [0.0, 0.0, 0.0]])
        state = (expm(a * DT) @ np.append(state, force[k]))[:2]
