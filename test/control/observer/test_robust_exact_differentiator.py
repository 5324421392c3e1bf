"""Exact where it claims to be, without bias and without chatter, and near the best bound under noise."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer import robust_exact_differentiator as red
from shake_ros.control.observer.robust_exact_differentiator import RobustExactDifferentiator
from shake_ros.control.observer.runner import NO_MODEL, step_of, work
from shake_ros.packing import records

DT = 0.001
NAME, SPACE = "robust_exact_differentiator", work()
Array = NDArray[np.float64]
BOUNDS = {2: 300.0, 3: 3e4}  # L by order


def differentiated(order: int, positions: Array, bound: float | None = None, dt: float = DT) -> Array:
    parameters = RobustExactDifferentiator(order=order, highest_derivative=bound or BOUNDS[order])
    law, step = records(OBSERVERS, parameters, derived=parameters.derive(dt, None)), step_of(NAME)
    state, estimates = np.zeros(4), np.empty((len(positions), 3))
    for k, position in enumerate(positions):
        step(state, law, NO_MODEL, np.array([position]), 0.0, dt, SPACE, estimates[k])
    return estimates


def polynomial(coefficients: list[float], samples: int) -> tuple[Array, Array]:
    """Position and (position, velocity, acceleration) of Σ c_i t^i."""
    p = np.polynomial.Polynomial(coefficients)
    t = np.arange(samples) * DT
    return p(t), np.column_stack([p(t), p.deriv()(t), p.deriv(2)(t)])


@pytest.mark.parametrize("order", [2, 3])
def test_no_bias_on_a_constant_acceleration(order: int) -> None:
    positions, motion = polynomial([0.01, 0.1, -0.5], 600)
    error = differentiated(order, positions)[400:] - motion[400:]
    assert np.all(np.abs(error).max(axis=0) < [1e-15, 1e-10, 1e-6])  # rounding, divided by h and h²


def test_third_order_has_no_bias_on_a_constant_jerk() -> None:
    positions, motion = polynomial([0.01, 0.1, -0.5, 1.0], 600)
    error = differentiated(3, positions)[400:] - motion[400:]
    assert np.all(np.abs(error).max(axis=0) < [1e-15, 1e-10, 1e-6])


def test_raw_states_lag_by_half_a_sample_and_the_outputs_do_not() -> None:
    # why the outputs are combinations: the backward difference of c t²/2 is late by c h/2
    parameters = RobustExactDifferentiator(order=2, highest_derivative=300.0)
    law, step = records(OBSERVERS, parameters, derived=parameters.derive(DT, None)), step_of(NAME)
    positions, motion = polynomial([0.0, 0.0, 1.0], 600)
    state, estimate = np.zeros(4), np.empty(3)
    for position in positions:
        step(state, law, NO_MODEL, np.array([position]), 0.0, DT, SPACE, estimate)
    assert motion[-1, 1] - state[1] == pytest.approx(0.5 * 2.0 * DT, rel=1e-6)
    assert estimate[1] == pytest.approx(motion[-1, 1], abs=1e-10)


@pytest.mark.parametrize("order", [2, 3])
def test_no_chatter_in_steady_state(order: int) -> None:
    positions, _ = polynomial([0.01, 0.1, -0.5], 1400)
    acceleration = differentiated(order, positions)[400:, 2]
    assert np.abs(np.diff(acceleration)).sum() < 1e-5  # a thousand roundings of 1e-17 m divided by h²


def test_explicit_discretisation_chatters_where_the_implicit_one_does_not() -> None:
    positions, _ = polynomial([0.01, 0.1, -0.5], 1400)
    k0, k1, k2 = RobustExactDifferentiator(order=2, highest_derivative=300.0).derive(DT, None).values()
    x, acceleration = np.zeros(3), np.empty(1400)
    for k, position in enumerate(positions):
        error = position - x[0]
        push = np.array([k0 * np.cbrt(error) ** 2 * np.sign(error), k1 * np.cbrt(error), k2 * np.sign(error)])
        x = x + DT * (np.array([x[1], x[2], 0.0]) + push)
        acceleration[k] = x[2]
    assert np.abs(np.diff(acceleration[400:])).sum() > 100.0


@pytest.mark.parametrize("order", [2, 3])
def test_error_equation_is_solved(order: int) -> None:
    gains = tuple(RobustExactDifferentiator(order=order, highest_derivative=BOUNDS[order]).derive(DT, None).values())
    powers = DT ** np.arange(1, order + 2)
    for rest in np.geomspace(1.0001 * powers[order] * gains[order], 1.0, 40):
        s = red.error_root(order, (*gains, 0.0)[:4], rest, DT)
        terms = sum(powers[i] * gains[i] * s ** (order - i) for i in range(order + 1))
        assert s > 0.0
        assert s ** (order + 1) + terms == pytest.approx(rest, rel=1e-10)


@pytest.mark.parametrize("order", [2, 3])
def test_sliding_lasts_up_to_the_bound_of_the_highest_derivative(order: int) -> None:
    # the sign can make up any |derivative n + 1| ≤ 1.1 L: then the first state is the measurement itself
    bound = BOUNDS[order]
    factorial = [1.0, 1.0, 2.0, 6.0, 24.0]
    for share, slides in ((1.0, True), (1.4, False)):
        coefficients = [0.0] * (order + 1) + [share * bound / factorial[order + 1]]
        positions, _ = polynomial(coefficients, 300)
        late = np.abs(differentiated(order, positions)[100:, 0] - positions[100:]).max()
        assert (late < 1e-12) == slides


def test_converges_as_the_finely_stepped_explicit_one() -> None:
    bound, fine, end = 300.0, 2e-6, 0.12
    k0, k1, k2 = RobustExactDifferentiator(order=2, highest_derivative=bound).derive(DT, None).values()
    x, y, z = 0.0, 0.0, 0.0
    count = round(end / fine)
    for k in range(count):
        error = 0.01 + 0.1 * k * fine - x
        root = abs(error) ** (1.0 / 3.0)
        sign = 1.0 if error > 0.0 else -1.0
        x, y, z = x + fine * (y + k0 * root * root * sign), y + fine * (z + k1 * root * sign), z + fine * k2 * sign
        if k == count // 6:
            early = x, y, z
    positions, _ = polynomial([0.01, 0.1], 121)
    found = differentiated(2, positions)
    assert found[20, 1] == pytest.approx(early[1], abs=0.08)
    assert found[-1, 1] == pytest.approx(y, abs=0.02)


@pytest.mark.parametrize("seed", [1, 2])
def test_velocity_error_under_bounded_noise_is_near_the_best_possible_bound(seed: int) -> None:
    # no exact differentiator can promise less than 2√(2NL) + LΔ/2; Levant's promises a small multiple of it
    noise, frequency, amplitude = 2e-5, 12.0, 0.02
    t = np.arange(4000) * DT
    positions = amplitude * np.sin(frequency * t) + np.random.RandomState(seed).uniform(-noise, noise, t.size)
    error = differentiated(2, positions, bound=amplitude * frequency**3)[1000:, 1]
    error -= amplitude * frequency * np.cos(frequency * t[1000:])
    assert np.abs(error).max() < 1.5 * red.worst_case(noise, amplitude * frequency**2, DT)


def test_worst_case_is_the_formula_by_hand() -> None:
    assert red.worst_case(8e-6, 4.0, 1e-3) == pytest.approx(2.0 * 8e-3 + 2e-3)
