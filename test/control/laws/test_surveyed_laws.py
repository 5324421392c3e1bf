"""Linear-quadratic, differential-pressure, feedforward-adaptive and reaction-compensating control: their equations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_lyapunov

from shake_ros.control.laws import CONTROLLERS, differential_pressure, linear_quadratic, reaction_compensation
from shake_ros.control.laws.runner import HEAD, Controller
from shake_ros.settings import load_variant

DT = 0.001
BETA = (-4154.0, -4.96, 2546.0)  # of config/observer/linear_soft_zone.yaml
DEVIATIONS = (0.2, 0.12, 10.0, 1000.0)  # that config/controller/linear_quadratic.yaml names


def built(name: str, **changes: Any) -> Controller:
    kind, parameters = load_variant("controller", name, CONTROLLERS)
    return Controller(kind, parameters.replace(start_time=0.0, **changes), DT)


def linear_run(controller: Controller, rates: Any, column: Any, reference: Any, start: Any) -> Any:
    """States (n, len(start)) of ẋ = rates x + column u under a law that sees x, ẋ, ẍ, the first three, exactly."""
    whole = expm(DT * np.block([[rates, column[:, None]], [np.zeros((1, len(start) + 1))]]))
    onto, push = whole[:-1, :-1], whole[:-1, -1]
    y, state, found = np.array(start), controller.initial_state(), []
    for wanted in reference:
        found.append(y)
        state, u = controller.step(state, wanted, y[:3])
        y = onto @ y + push * u
    return np.array(found)


def reduced_rates(beta: tuple[float, float, float]) -> Any:
    """ẋ, ẍ, x⃛ of the reduced model, (3, 3) and (3,)."""
    return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, beta[0], beta[1]]]), np.array([0.0, 0.0, beta[2]])


def sine(amplitude: float, frequency: float, seconds: float) -> Any:
    """Reference (n, 3) of a sine [m]."""
    omega = 2.0 * math.pi * frequency
    phase = omega * DT * np.arange(round(seconds / DT))
    waves = np.sin(phase), omega * np.cos(phase), -(omega**2) * np.sin(phase)
    return amplitude * np.stack(waves, axis=1)


def test_linear_quadratic_control_is_its_difference_equation() -> None:
    controller = built("linear_quadratic")
    p: Any = controller.parameters
    state, _ = controller.step(controller.initial_state(), (0.0, 0.0, 0.0), (0.002, 0.0, 0.0))
    _, u = controller.step(state, (0.01, 0.1, 2.0), (0.011, 0.3, 5.0))
    back = p.proportional_gain * 0.001 + p.integral_gain * 0.003 * DT + p.velocity_gain * 0.2
    ahead = p.feedforward_gain * 0.1 + p.feedforward_acceleration * 2.0
    assert u == pytest.approx(back + p.acceleration_gain * 3.0 + ahead)


def test_gains_of_the_configuration_are_the_optimal_ones() -> None:
    p: Any = built("linear_quadratic").parameters
    gains = -linear_quadratic.optimal(BETA, DEVIATIONS, DT)
    written = p.integral_gain, p.proportional_gain, p.velocity_gain, p.acceleration_gain
    np.testing.assert_allclose(written, gains[:4], rtol=2e-3)
    assert p.feedforward_gain == pytest.approx(-BETA[0] / BETA[2], rel=1e-3)
    assert p.feedforward_acceleration == pytest.approx(-BETA[1] / BETA[2], rel=1e-2)


def test_no_neighbouring_gains_cost_less_than_the_optimal_ones() -> None:
    matrix, column = linear_quadratic.error_model(BETA, DT)
    best = linear_quadratic.optimal(BETA, DEVIATIONS, DT)
    weights = np.append(1.0 / np.square(DEVIATIONS), 0.0)

    def cost(gains: Any) -> float:
        """Of the whole way home from 10 mm: Σ y'(W + k k')y by Lyapunov's equation."""
        closed, start = matrix - np.outer(column, gains), np.array([0.0, 0.01, 0.0, 0.0, 0.0])
        total = solve_discrete_lyapunov(closed.T, np.diag(weights) + np.outer(gains, gains))
        return float(start @ total @ start)

    least = cost(best)
    for i in range(4):
        for factor in (0.9, 1.1):
            changed = best.copy()
            changed[i] *= factor
            assert cost(changed) > least


def test_pressure_stabilisation_is_its_difference_equation() -> None:
    controller = built("differential_pressure", force_balance=0.5)
    p: Any = controller.parameters
    state, _ = controller.step(controller.initial_state(), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    _, u = controller.step(state, (0.0, 0.0, 2.0), (0.001, 0.0, 4.0))
    before, now = (p.moved_mass / p.piston_area * a for a in (1.0, 4.0 - 0.5 * 2.0))
    fade = math.exp(-p.washout * DT)
    passed = fade * before + (now - before) * (1.0 - fade) / (p.washout * DT)
    assert u == pytest.approx(p.proportional_gain * 0.001 + p.integral_gain * 0.001 * DT - p.pressure_gain * passed)


def test_washed_out_pressure_of_a_ramp_is_the_closed_form() -> None:
    # ẏ + ω y = 3 from zero: y = 3/ω (1 − exp(−ω t)), whatever the sample time
    for dt in (0.001, 0.01):
        y = 0.0
        for k in range(round(0.1 / dt)):
            y = differential_pressure.washed_out(y, 3.0 * k * dt, 3.0 * (k + 1) * dt, 20.0, dt)
        assert y == pytest.approx(3.0 / 20.0 * (1.0 - math.exp(-2.0)), rel=1e-12)


def test_pressure_gain_damps_the_oil_column_by_what_it_says() -> None:
    """Decay rate of the ringing: −β_2/2 without, and β_3 K_dp M/A_p/2 more with it."""
    small = {"proportional_gain": -1e-6, "integral_gain": -1e-9, "washout": 0.0, "limit": 1.0}
    still, decays = np.zeros((600, 3)), []
    for gain in (0.0, 1e-8):
        controller = built("differential_pressure", pressure_gain=gain, **small)
        run = linear_run(controller, *reduced_rates(BETA), still, [0.0, 0.0, 0.5])
        envelope = np.sqrt(run[:, 2] ** 2 - BETA[0] * run[:, 1] ** 2)  # of a lightly damped oscillation
        decays.append(-np.polyfit(DT * np.arange(600), np.log(envelope), 1)[0])
    p: Any = controller.parameters
    added = 0.5 * BETA[2] * 1e-8 * p.moved_mass / p.piston_area
    assert decays[0] == pytest.approx(-0.5 * BETA[1], rel=0.03)
    assert decays[1] - decays[0] == pytest.approx(added, rel=0.1)  # the hold of a sample takes a little


def test_feedforward_adaptation_finds_the_gain_of_an_integrating_plant() -> None:
    """ẋ = 0.5 u, while three-variable control is set for 0.61: the error falls though no state is fed to Φ_r r."""
    reference, errors = sine(0.02, 1.0, 40.0), []
    for weight in (0.0, 60.0):
        controller = built("feedforward_minimal_control", filter_frequency=0.0, adaptation_integral=weight)
        x, u, state, away = 0.0, 0.0, controller.initial_state(), []
        for wanted in reference:
            state, u = controller.step(state, wanted, (x, 0.5 * u, wanted[2]))
            x += 0.5 * u * DT
            away.append(x - wanted[0])
        errors.append(float(np.std(away[-4000:])))
    assert errors[1] < 0.4 * errors[0]
    adapted = state[HEAD + 6 :]
    assert np.all(adapted[:2] == 0.0)
    assert np.any(adapted[2:] != 0.0)


def test_specimen_in_the_law_is_the_closed_form() -> None:
    """z̈ + 2ζω ż + ω² z = −â under an acceleration that runs straight, against the matrix exponential."""
    omega, zeta, slope = 37.7, 0.03, 40.0
    system = np.zeros((4, 4))  # z, ż, â, its slope
    system[0, 1], system[2, 3] = 1.0, 1.0
    system[1, :3] = -(omega**2), -2.0 * zeta * omega, -1.0
    wanted = expm(0.05 * system) @ [0.001, -0.02, 0.7, slope]
    z, rate = 0.001, -0.02
    for k in range(50):
        z, rate = reaction_compensation.carried(
            z, rate, 0.7 + slope * k * DT, 0.7 + slope * (k + 1) * DT, omega, zeta, DT
        )
    np.testing.assert_allclose((z, rate), wanted[:2], rtol=1e-9)


def with_specimen(mass: float, p: Any) -> tuple[Any, Any]:
    """The reduced model of `bergamo` with a specimen on a spring: x, ẋ, ẍ, z, ż."""
    omega, zeta, share = p.compensated_frequency, p.compensated_damping, mass / p.moved_mass
    rates, column = np.zeros((5, 5)), np.zeros(5)
    rates[0, 1] = rates[1, 2] = rates[3, 4] = 1.0
    rates[4] = 0.0, 0.0, -1.0, -(omega**2), -2.0 * zeta * omega  # z̈
    rates[2, 1:3] = -2.596e4, -30.98
    rates[2] += share * 2.0 * zeta * omega * rates[4]
    rates[2, 4] += share * omega**2
    column[2] = p.beta3
    rates[2], column[2] = rates[2] / (1.0 - share), column[2] / (1.0 - share)  # what sways is not bolted to the table
    return rates, column


def test_a_compensated_specimen_moves_the_table_as_a_bolted_mass_would() -> None:
    """150 kg of 650 kg on 6 Hz, followed at 5 Hz: departure from the run with all mass bolted to the table."""
    p: Any = built("reaction_compensation").parameters
    reference = sine(0.005, 5.0, 3.0)
    start = [*reference[0], 0.0, 0.0]
    bolted = linear_run(built("reaction_compensation", compensation=0.0), *with_specimen(0.0, p), reference, start)
    away = []
    for compensation in (0.0, 1.0):
        controller = built("reaction_compensation", compensation=compensation, compensation_corner=1000.0)
        run = linear_run(controller, *with_specimen(150.0, p), reference, start)
        away.append(float(np.std((run - bolted)[1500:, 2])))
    assert away[1] < 0.4 * away[0]
