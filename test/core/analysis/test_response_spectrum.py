"""Response spectrum against closed forms and an independent integration."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shake_ros.core.analysis.response_spectrum import response_spectrum
from shake_ros.core.quantities import ShakeError
from shake_ros.core.reference.baseline import integrate

PERIODS = np.array([0.1, 0.5, 1.0, 2.0])


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.3])
def test_constant_acceleration_gives_the_overshoot_of_the_closed_form(damping: float) -> None:
    relative, velocity, _ = response_spectrum(np.full(601, 2.0), 0.01, PERIODS, damping)
    omega = 2.0 * np.pi / PERIODS
    expected = 2.0 / omega**2 * (1.0 + np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)))
    assert np.allclose(relative, expected, rtol=0.004)
    assert np.array_equal(velocity, omega * relative)


def test_resonance_reaches_one_over_twice_the_damping() -> None:
    time = np.arange(60001) * 0.001
    _, _, absolute = response_spectrum(np.sin(2.0 * np.pi * time), 0.001, np.array([1.0]), 0.05)
    assert absolute[0] == pytest.approx(np.sqrt(1.0 + 1.0 / (4.0 * 0.05**2)), rel=0.003)


def test_stiff_oscillator_follows_the_ground_and_a_soft_one_stays_behind() -> None:
    time = np.arange(2001) * 0.01
    acceleration = np.sin(2.0 * np.pi * time) * np.sin(np.pi * time / 20.0) ** 2
    relative, _, absolute = response_spectrum(acceleration, 0.01, np.array([0.005, 500.0]), 0.05)
    assert absolute[0] == pytest.approx(np.max(np.abs(acceleration)), rel=0.01)
    _, ground = integrate(acceleration, 0.01)
    assert relative[1] == pytest.approx(np.max(np.abs(ground)), rel=0.01)


def test_noise_agrees_with_an_independent_integration() -> None:
    acceleration = np.random.RandomState(1).standard_normal(101)
    time = np.arange(101) * 0.05
    omega, damping = 2.0 * np.pi / 0.4, 0.05
    solution = solve_ivp(
        lambda t, s: (s[1], -np.interp(t, time, acceleration) - 2.0 * damping * omega * s[1] - omega**2 * s[0]),
        (0.0, 5.0),
        (0.0, 0.0),
        t_eval=np.arange(5001) * 0.001,
        rtol=1e-9,
        atol=1e-12,
        max_step=0.01,
    )
    relative, _, absolute = response_spectrum(acceleration, 0.05, np.array([0.4]), damping)
    total = np.abs(2.0 * damping * omega * solution.y[1] + omega**2 * solution.y[0])
    assert relative[0] == pytest.approx(np.max(np.abs(solution.y[0])), rel=0.003)
    assert absolute[0] == pytest.approx(np.max(total), rel=0.003)


@pytest.mark.parametrize(
    ("periods", "damping", "message"),
    [(np.array([0.0]), 0.05, "above 0 s"), (PERIODS, 1.0, "outside"), (np.array([]), 0.05, "above 0 s")],
)
def test_impossible_oscillators_are_refused(periods: np.ndarray, damping: float, message: str) -> None:
    with pytest.raises(ShakeError, match=message):
        response_spectrum(np.ones(10), 0.01, periods, damping)


def test_a_single_sample_is_no_record() -> None:
    with pytest.raises(ShakeError, match="no record"):
        response_spectrum(np.ones(1), 0.01, PERIODS, 0.05)
