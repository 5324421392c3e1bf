"""Equations of PID, implicit super-twisting, three-variable control and minimal control synthesis; the dispatch."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shake_ros.control.laws import CONTROLLERS, minimal_control_synthesis, pid, three_variable
from shake_ros.control.laws import law as input_filter
from shake_ros.control.laws import super_twisting_implicit as implicit
from shake_ros.control.laws.runner import HEAD, Controller, feedforward_law, step_law
from shake_ros.control.reference import program as reference_filter
from shake_ros.packing import kernel_of, numbers, records
from shake_ros.physics.plant import reduced
from shake_ros.settings import load_variant

DT = 0.001
BETA = (-2.596e4, -30.98, 1.591e4)  # of the table bergamo


def built(name: str, **changes: Any) -> Controller:
    kind, parameters = load_variant("controller", name, CONTROLLERS)
    return Controller(kind, parameters.replace(**changes), DT)


def law_record(parameters: Any) -> Any:
    return records(CONTROLLERS, parameters)[0]


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_number_of_a_law_leads_to_that_law(name: str) -> None:
    parameters = load_variant("controller", name, CONTROLLERS)[1]
    p, feedforward, step = law_record(parameters), *(kernel_of(CONTROLLERS[name], k) for k in ("feedforward", "step"))
    state, reference, estimate = (
        np.full(parameters.states, 1e-3),
        np.array([0.01, 0.1, 1.0]),
        np.array([0.011, 0.08, 1.5]),
    )
    assert feedforward_law(p, reference) == feedforward(p, reference)
    found = step_law(state, p, reference, estimate, 0.1, DT)
    wanted = step(state, p, reference, estimate, 0.1, DT)
    np.testing.assert_array_equal(found[0], wanted[0])
    assert found[1] == wanted[1]
    assert found[0].size == parameters.states


def test_every_law_has_a_number_of_its_own() -> None:
    assert len({law.code for law in CONTROLLERS.values()}) == len(CONTROLLERS)


def test_under_a_model_a_law_leaves_out_what_the_model_brings() -> None:
    sliding, three = (
        load_variant("controller", n, CONTROLLERS)[1].under_model() for n in ("sliding_mode", "three_variable")
    )
    assert (sliding.beta4, sliding.beta5) == (0.0, 0.0)
    assert three.filter_frequency == 0.0
    assert three.reference_velocity == three.feedback_velocity
    pid_gains = load_variant("controller", "pid", CONTROLLERS)[1]
    assert pid_gains.under_model() == pid_gains


def test_pid_is_its_difference_equation() -> None:
    controller = built("pid", start_time=0.0)
    p: Any = controller.parameters
    state, _ = controller.step(controller.initial_state(), (0.002, 0.0, 0.0), (0.0, 0.0, 0.0))
    _, u = controller.step(state, (0.011, 0.3, 0.0), (0.010, 0.1, 5.0))
    # (5.2) by hand: e = 0.001, ∫e = 0.003·dt, ė = 0.2
    assert u == pytest.approx(p.proportional_gain * 0.001 + p.integral_gain * 0.003 * DT + p.derivative_gain * 0.2)


def test_filtered_derivative_of_a_ramp_is_the_closed_form() -> None:
    # ḋ = ω (ė − d) with ė = 3 from rest: d = 3 (1 − exp(−ω t)), whatever the sample time
    for dt in (0.001, 0.01):
        d = 0.0
        for k in range(round(0.05 / dt)):
            d = pid.filtered_derivative(d, 3.0 * k * dt, 3.0 * (k + 1) * dt, 40.0, dt)
        assert d == pytest.approx(3.0 * (1.0 - math.exp(-2.0)), rel=1e-12)


@pytest.mark.parametrize("surface", [1e-9, 4e-5, -3e-4, 0.02, -5.0])
def test_implicit_root_and_sign_solve_their_inclusion(surface: float) -> None:
    k1, k2 = 30.0, 150.0
    root, sign = implicit.root_and_sign(surface, k1, k2, DT)
    z = root * abs(root)
    assert z + DT * k1 * root + DT**2 * k2 * sign == pytest.approx(surface, rel=1e-12)
    assert abs(sign) <= 1.0
    assert z == 0.0 or sign == math.copysign(1.0, z)


def surface_run(
    law: str, slope: float, limit: float, seconds: float, start: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """S and w of Ṡ = w + φ, φ = 0.3 sin, sampled at DT with w held and limited; φ's slope is at most `slope`.

    `law` is "implicit", "winding" (the same with an integral that does not know of the limit) or "explicit".
    """
    k1, k2 = 1.5 * math.sqrt(slope), 1.1 * slope
    s, twist, times = start, 0.0, np.arange(round(seconds / DT)) * DT
    found, applied = np.empty(times.size), np.empty(times.size)
    omega = slope / 0.3
    for k, t in enumerate(times):
        if law == "explicit":
            sign = math.copysign(1.0, s)
            twist -= DT * k2 * sign
            wanted = -k1 * math.sqrt(abs(s)) * sign + twist
        else:
            wanted = implicit.twisting(s, twist, k1, k2, DT)
        w = min(max(wanted, -limit), limit)
        if law != "explicit":
            twist = implicit.conditioned(twist, w if law == "implicit" else wanted, k2, DT)
        found[k], applied[k] = s, w
        s += DT * w + 0.3 / omega * (math.cos(omega * t) - math.cos(omega * (t + DT)))
    return found, applied


def test_implicit_super_twisting_keeps_the_best_bound_on_the_surface() -> None:
    # no law with a held command can promise less than L T²
    found, applied = surface_run("implicit", slope=5.0, limit=10.0, seconds=4.0, start=0.5)
    assert np.max(np.abs(found[3000:])) <= 5.0 * DT**2 * (1.0 + 1e-6)
    travel_of_disturbance = 4.0 * 0.3 * (5.0 / 0.3) / (2.0 * math.pi)  # in a second
    assert np.sum(np.abs(np.diff(applied[3000:]))) < 1.05 * travel_of_disturbance + 0.05


def test_explicit_super_twisting_chatters_where_the_implicit_one_does_not() -> None:
    runs = {law: surface_run(law, slope=5.0, limit=10.0, seconds=3.0, start=0.0) for law in ("implicit", "explicit")}
    error = {law: np.max(np.abs(found[2000:])) for law, (found, _) in runs.items()}
    travel = {law: np.sum(np.abs(np.diff(applied[2000:]))) for law, (_, applied) in runs.items()}
    assert error["implicit"] < 0.5 * error["explicit"]
    assert travel["implicit"] < 0.5 * travel["explicit"]


def test_implicit_super_twisting_does_not_wind_up() -> None:
    found, applied = surface_run("implicit", slope=5.0, limit=0.6, seconds=6.0, start=1.5)
    assert applied[0] == -0.6
    assert np.min(found) > -0.05
    assert np.max(np.abs(found[5000:])) <= 5.0 * DT**2 * (1.0 + 1e-6)
    wound, _ = surface_run("winding", slope=5.0, limit=0.6, seconds=6.0, start=1.5)
    assert np.min(wound) < -0.5


def test_input_filter_of_a_law_is_that_of_the_reference() -> None:
    rng = np.random.default_rng(2)
    wish = np.cumsum(rng.normal(size=60)) * 1e-3
    wanted = reference_filter.apply(wish, 250.0, 0.7, DT)
    x, v = wish[0], 0.0
    for k in range(1, wish.size):
        x, v, a = input_filter.advance(x, v, wish[k - 1], wish[k], 250.0, 0.7, DT)
        np.testing.assert_allclose([x, v, a], wanted[k], rtol=1e-8, atol=1e-9)


def test_three_variable_is_its_difference_equation_without_a_filter() -> None:
    controller = built("three_variable", start_time=0.0, filter_frequency=0.0)
    p: Any = controller.parameters
    _, u = controller.step(controller.initial_state(), (0.01, 0.1, 2.0), (0.011, 0.09, 1.5))
    there = p.reference_displacement * 0.01 + p.reference_velocity * 0.1 + p.reference_acceleration * 2.0
    back = p.feedback_displacement * 0.011 + p.feedback_velocity * 0.09 + p.feedback_acceleration * 1.5
    assert u == pytest.approx(there - back)


@pytest.mark.parametrize("frequency", [0.0, 314.0])
def test_matched_three_variable_loop_is_flat_to_the_second_order(frequency: float) -> None:
    # the transfer function x/wish at small s: 1 + O(s³); at 1 Hz and 2 Hz the error grows eightfold
    parameters: Any = load_variant("controller", "three_variable", CONTROLLERS)[1]
    p = three_variable.matched(parameters.replace(filter_frequency=frequency), np.array(BETA))
    errors = []
    for hertz in (1.0, 2.0):
        s = 2j * math.pi * hertz
        there = p.reference_displacement + p.reference_velocity * s + p.reference_acceleration * s**2
        back = p.feedback_displacement + p.feedback_velocity * s + p.feedback_acceleration * s**2
        if frequency:
            there /= 1.0 + 2.0 * p.filter_damping * s / frequency + (s / frequency) ** 2
        plant = BETA[2] / (s * (s**2 - BETA[1] * s - BETA[0]))
        errors.append(abs(plant * there / (1.0 + plant * back) - 1.0))
    assert errors[1] / errors[0] == pytest.approx(8.0, rel=0.2)


def test_printed_three_variable_gains_are_the_matched_ones() -> None:
    parameters: Any = load_variant("controller", "three_variable", CONTROLLERS)[1]
    matched = three_variable.matched(parameters, np.array(BETA))
    assert parameters.reference_velocity == pytest.approx(matched.reference_velocity, rel=1e-3)
    assert parameters.reference_acceleration == pytest.approx(matched.reference_acceleration, rel=1e-3)


def test_minimal_control_synthesis_is_its_difference_equation() -> None:
    controller = built("minimal_control_synthesis", start_time=0.0, proportional_gain=0.0, integral_gain=0.0)
    p: Any = controller.parameters
    w, c, alpha, beta = p.model_frequency, p.velocity_weight, p.adaptation_integral, p.adaptation_proportional
    start, _ = controller.step(controller.initial_state(), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    state, u = controller.step(start, (0.01, 0.1, 2.0), (0.008, 0.05, 1.5))
    # by hand: the model is on the reference, the adaptive integrals are zero
    error = w * 0.002 + c * 0.05
    regressors = np.array([w * 0.008, 0.05, w * 0.01, 0.1, 2.0 / w])
    np.testing.assert_allclose(state[HEAD + 4 :], alpha * error * regressors * DT, rtol=1e-12)
    wanted = np.sum((alpha * DT + beta) * error * regressors**2) + p.feedforward_gain * 0.1
    assert u == pytest.approx(float(wanted))


def test_reference_model_starts_where_the_table_is_and_closes_on_the_reference() -> None:
    controller = built("minimal_control_synthesis")
    state = controller.initial_state()
    for k in range(1000):
        state, _ = controller.step(state, (0.02, 0.0, 0.0), (0.0, 0.0, 0.0))
        if k == 0:
            assert state[HEAD + 2] == -0.02
    assert abs(state[HEAD + 2]) < 1e-6


@pytest.mark.parametrize("strategy", ["inner", "outer"])
def test_minimal_control_synthesis_adapts_to_a_plant_it_does_not_know(strategy: str) -> None:
    # reduced plant with 30 % less velocity gain than the feedforward assumes, and no integral action
    beta = numbers(reduced.ReducedParameters(BETA[0], BETA[1] * 3.0, 0.7 * BETA[2], 0.0, 0.0))[0]
    errors = {}
    for label, weight in (("fixed", 0.0), ("adaptive", 1.0)):
        p: Any = load_variant("controller", "minimal_control_synthesis", CONTROLLERS)[1]
        controller = built(
            "minimal_control_synthesis",
            strategy=strategy,
            integral_gain=0.0,
            adaptation_integral=weight * p.adaptation_integral,
            adaptation_proportional=weight * p.adaptation_proportional,
        )
        state, z, missed = controller.initial_state(), np.zeros(3), []
        for k in range(8000):
            phase = 2.0 * math.pi * k * DT
            r = (0.03 * math.sin(phase), 0.06 * math.pi * math.cos(phase), -0.12 * math.pi**2 * math.sin(phase))
            missed.append(z[0] - r[0])
            state, u = controller.step(state, r, z)
            z = reduced.advance(z, beta, u, 0.0, DT)
        errors[label] = float(np.std(missed[6000:]))
        assert np.max(np.abs(state[HEAD + 4 :])) <= p.gain_limit
    assert errors["adaptive"] < 0.5 * errors["fixed"]


def test_adaptive_gains_cannot_leave_their_bound_and_fade_without_error() -> None:
    p: Any = load_variant("controller", "minimal_control_synthesis", CONTROLLERS)[1]
    packed = law_record(p.replace(leakage=2.0))
    gains, signal = np.zeros(5), 0.0
    for _ in range(5000):
        gains, signal = minimal_control_synthesis.adapt(gains, np.ones(5), 10.0, packed, DT)
    assert np.all(gains == p.gain_limit)
    assert signal == pytest.approx(5.0 * p.gain_limit)
    for _ in range(1000):
        gains, _ = minimal_control_synthesis.adapt(gains, np.ones(5), 0.0, packed, DT)
    np.testing.assert_allclose(gains, p.gain_limit * math.exp(-2.0))
