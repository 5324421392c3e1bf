"""The reduced model (6.36) and its exact step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from shake_ros.control.observer import OBSERVERS
from shake_ros.packing import numbers
from shake_ros.physics.plant import reduced
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import OutOfBounds
from shake_ros.settings import load_table, load_variant

DT = 0.001


@pytest.fixture(scope="module")
def thesis() -> np.void:
    """β of table 6.11."""
    p = load_variant("observer", "sliding_mode", OBSERVERS)[1]
    return numbers(reduced.ReducedParameters(p.beta1, p.beta2, p.beta3, p.beta4, p.beta5))[0]


def continuous(beta: np.void, opening: float) -> np.ndarray:
    """(4, 4) generator of (z_1, z_2, z_3, held jerk)."""
    matrix = np.zeros((4, 4))
    matrix[0, 1] = matrix[1, 2] = matrix[2, 3] = 1.0
    matrix[2, 1], matrix[2, 2] = beta[0] + beta[4] * opening, beta[1] + beta[3] * opening
    return matrix


@pytest.mark.parametrize("opening", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("dt", [1e-4, 1e-3, 2e-2])
def test_transition_is_the_matrix_exponential(thesis: np.void, opening: float, dt: float) -> None:
    phi, gamma = reduced.transition(thesis[0] + thesis[4] * opening, thesis[1] + thesis[3] * opening, dt)
    exact = expm(continuous(thesis, opening) * dt)
    np.testing.assert_allclose(phi, exact[:3, :3], rtol=1e-9, atol=1e-9 * np.abs(exact).max())
    np.testing.assert_allclose(gamma, exact[:3, 3], rtol=1e-9)


def test_transition_of_a_triple_integrator_needs_no_special_case() -> None:
    phi, gamma = reduced.transition(0.0, 0.0, 0.1)
    np.testing.assert_allclose(phi, [[1.0, 0.1, 0.005], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]], rtol=1e-14)
    np.testing.assert_allclose(gamma, [0.1**3 / 6.0, 0.1**2 / 2.0, 0.1], rtol=1e-14)


def test_exact_step_is_stable_where_forward_euler_is_not(thesis: np.void) -> None:
    phi, _ = reduced.transition(thesis[0], thesis[1], DT)
    euler = np.eye(3) + DT * continuous(thesis, 0.0)[:3, :3]
    assert max(abs(np.linalg.eigvals(phi[1:, 1:]))) < 1.0
    assert max(abs(np.linalg.eigvals(euler[1:, 1:]))) == pytest.approx(1.0039, abs=1e-4)


def test_steady_velocity_is_the_velocity_gain_times_the_command(thesis: np.void) -> None:
    state = np.zeros(3)
    for _ in range(10_000):
        state = reduced.advance(state, thesis, 0.5, 0.0, DT)
    a = thesis[0] + 0.5 * thesis[4]
    assert state[1] == pytest.approx(-thesis[2] * 0.5 / a, rel=1e-6)


def test_closed_form_follows_the_full_table_at_small_openings() -> None:
    # the sixth-order table with a critical centre and without dry friction, driven gently: velocity within 3 %
    table = load_table("bergamo").with_values(
        {
            "friction.coulomb_level": 0.0,
            "friction.stribeck_rise": 0.0,
            "friction.viscous": 300.0,
            "valve.hysteresis": 0.0,
            "valve.underlap": 0.0,
        }
    )
    beta = numbers(reduced.closed_form(table).beta)[0]
    u = 0.15 * np.sin(2.0 * np.pi * 4.0 * np.arange(2000) * DT)
    full = run(table, u, DT)
    state, velocity = np.zeros(3), np.empty(2000)
    for k in range(2000):
        velocity[k] = state[1]
        state = reduced.advance(state, beta, u[k], 0.0, DT)
    tail = slice(500, None)
    # the full valve lags by 2 D/ω_v = 0.92 ms, which the reduced model leaves out
    late = np.interp(np.arange(2000) - 0.92, np.arange(2000), velocity)
    assert np.sqrt(np.mean((full[tail, 1] - late[tail]) ** 2)) < 0.03 * np.std(full[tail, 1])


def test_closed_form_leads_to_the_hydraulic_frequency() -> None:
    beta = reduced.closed_form(load_table("bergamo").with_values({"friction.viscous": 0.0})).beta
    stiffness = 2.0 * 1.16e9 * 9.4562e-4**2 / 1.2293e-4  # (2.25): both chambers of V_t/2
    assert -beta.beta1 == pytest.approx(stiffness / 650.0)


def test_closed_form_with_equal_areas_is_that_of_the_load_pressure() -> None:
    table = load_table("bergamo").with_values({"friction.viscous": 300.0, "leakage.internal": 2e-12})
    beta = reduced.closed_form(table).beta
    k, drop = 1.81e-7 * np.sqrt(0.5 * 205e5), 205e5
    leak = 2e-12 + 0.5e-12 + 0.005 * k / drop
    stiffness = 4.0 * 1.16e9 / 2.4586e-4  # of Ṗ_L
    assert beta.beta2 == pytest.approx(-stiffness * leak - 300.0 / 650.0)
    assert beta.beta1 == pytest.approx(-stiffness * (9.4562e-4**2 + leak * 300.0) / 650.0)
    assert beta.beta3 == pytest.approx(stiffness * 9.4562e-4 * k / 650.0)
    assert beta.beta4 == pytest.approx(-stiffness * k / (2.0 * drop))
    assert beta.beta5 == pytest.approx(-stiffness * k / (2.0 * drop) * 300.0 / 650.0)


def test_positive_beta_1_is_refused() -> None:
    with pytest.raises(OutOfBounds, match="beta1"):
        reduced.ReducedParameters(1.0, -1.0, 1.0, 0.0, 0.0)
