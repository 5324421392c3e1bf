"""Residual tests hold their level on noise and see what is left; coherence tells what a linear system leaves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from shake_ros.explain.residual_tests import coherent_mean_square, residual_test
from shake_ros.quantities import ShakeError

N = 6000
DT = 1e-3


def coloured(rng, n=N):
    """A smooth input, as a multisine is."""
    return lfilter([0.05], [1.0, -0.95], rng.standard_normal(n))


def test_white_noise_is_refused_in_about_one_case_of_a_hundred():
    rng = np.random.default_rng(1)
    results = [residual_test(rng.standard_normal(2000), coloured(rng, 2000)) for _ in range(300)]
    assert sum(not r.white for r in results) <= 9
    assert sum(not r.independent for r in results) <= 9


def test_coloured_noise_is_not_white_but_independent():
    rng = np.random.default_rng(2)
    results = [
        residual_test(lfilter([1.0], [1.0, -0.6], rng.standard_normal(3000)), coloured(rng, 3000)) for _ in range(100)
    ]
    assert not any(r.white for r in results)
    assert sum(not r.independent for r in results) <= 5


def test_a_small_part_of_the_input_is_seen_at_its_lag():
    rng = np.random.default_rng(3)
    u = rng.standard_normal(N)
    result = residual_test(rng.standard_normal(N) + 0.15 * np.roll(u, 7), u)
    assert not result.independent
    lag = int(np.argmax(np.abs(result.cross_correlation))) - 25
    assert lag == 7
    assert result.cross_correlation[25 + 7] > result.cross_bound


def test_correlations_have_the_lags_they_say():
    rng = np.random.default_rng(4)
    result = residual_test(rng.standard_normal(N), rng.standard_normal(N))
    assert result.autocorrelation.shape == (26,)
    assert result.cross_correlation.shape == (51,)
    assert result.autocorrelation[0] == pytest.approx(1.0)
    assert result.auto_bound == pytest.approx(2.5758 / np.sqrt(N), rel=1e-4)


def test_a_perfect_model_leaves_nothing_to_test():
    result = residual_test(np.zeros(N), np.ones(N))
    assert result.white and result.independent


@pytest.mark.parametrize("bad", [np.zeros(50), np.full(N, np.nan), np.zeros((N, 2))])
def test_a_residual_that_cannot_be_tested_is_refused(bad):
    with pytest.raises(ShakeError):
        residual_test(bad, np.zeros(N))


def test_what_a_linear_system_leaves_of_the_input_is_coherent_and_noise_is_not():
    rng = np.random.default_rng(5)
    u = coloured(rng, 20000)
    linear = lfilter([0.0, 0.4, 0.2], [1.0], u)
    noise = 0.1 * rng.standard_normal(20000)
    assert coherent_mean_square(linear + noise, u, DT) == pytest.approx(np.var(linear), rel=0.1)
    assert coherent_mean_square(noise, u, DT) < 0.05 * np.var(noise)


def test_an_even_nonlinearity_is_no_linear_dynamics():
    rng = np.random.default_rng(6)
    u = coloured(rng, 20000)
    bent = u**2 - np.mean(u**2)
    assert coherent_mean_square(bent + 0.001 * rng.standard_normal(20000), u, DT) < 0.15 * np.var(bent)
