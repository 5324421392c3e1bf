"""Contracts that every controller keeps, and the laws' equations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import HEAD, Controller, switch
from shake_ros.packing import kernel_of, records
from shake_ros.physics.plant import reduced
from shake_ros.quantities import OutOfBounds, ShakeError, UnknownName
from shake_ros.settings import config_folder, load_table, load_variant

DT = 0.001
CONFIGURATIONS = sorted(p.stem for p in (config_folder() / "controller").glob("*.yaml"))
INTEGRATING = ["feedforward_pi", "sliding_mode", "super_twisting", "pid", "linear_quadratic"]
LAWS = [n for n in CONTROLLERS if n != "none"]


def beta_of(parameters: Any) -> Any:
    """The reduced model's β as the record that `reduced.advance` takes."""
    return records(CONTROLLERS, parameters)[0]


def built(name: str, **changes: float) -> Controller:
    kind, parameters = load_variant("controller", name, CONTROLLERS)
    return Controller(kind, parameters.replace(**changes), DT)


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_controller_at_the_reference_commands_nothing(name: str) -> None:
    controller = built(name)
    _, u = controller.step(controller.initial_state(), (0.01, 0.0, 0.0), (0.01, 0.0, 0.0))
    assert u == 0.0


@pytest.mark.parametrize("name", [n for n in CONFIGURATIONS if n != "none"])
@pytest.mark.parametrize("error", [-0.1, -1e-3, 1e-3, 0.1])
def test_controller_pushes_back_towards_the_reference(name: str, error: float) -> None:
    controller = built(name, start_time=0.0)
    _, u = controller.step(controller.initial_state(), (0.0, 0.0, 0.0), (error, 0.0, 0.0))
    assert u * error < 0.0


@pytest.mark.parametrize("name", [n for n in CONFIGURATIONS if n != "none"])
def test_controller_is_odd(name: str) -> None:
    controller = built(name, start_time=0.0)
    reference, estimate = np.array([0.01, 0.1, 1.0]), np.array([0.011, 0.08, 1.5])
    _, u = controller.step(controller.initial_state(), reference, estimate)
    _, mirrored = controller.step(controller.initial_state(), -reference, -estimate)
    assert mirrored == -u


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_command_stays_within_the_limit(name: str) -> None:
    controller = built(name, limit=0.4)
    state = controller.initial_state()
    for k in range(200):
        state, u = controller.step(state, (0.1, 0.5, 0.0), (-0.1 * (-1.0) ** k, -0.5, 30.0))
        assert abs(u) <= 0.4


@pytest.mark.parametrize("name", CONFIGURATIONS)
@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_controller_refuses_what_is_not_a_number(name: str, place: int, value: float) -> None:
    controller = built(name)
    inputs = np.zeros(6)
    inputs[place] = value
    with pytest.raises(ShakeError, match="not finite"):
        controller.step(controller.initial_state(), inputs[:3], inputs[3:])


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_controller_leaves_its_inputs_untouched_and_repeats_itself(name: str) -> None:
    controller = built(name)
    state, reference, estimate = controller.initial_state(), np.array([0.01, 0.1, 1.0]), np.array([0.0, 0.2, -1.0])
    kept = state.copy(), reference.copy(), estimate.copy()
    first, second = controller.step(state, reference, estimate), controller.step(state, reference, estimate)
    assert first[1] == second[1]
    np.testing.assert_array_equal(first[0], second[0])
    for before, after in zip(kept, (state, reference, estimate), strict=True):
        np.testing.assert_array_equal(before, after)


@pytest.mark.parametrize("name", LAWS)
def test_start_away_from_the_reference_makes_no_bump(name: str) -> None:
    controller = built(name, start_time=0.2)
    state = controller.initial_state()
    commands = []
    for k in range(2000):
        place = 0.1 * k * DT
        state, u = controller.step(state, (place + 0.02, 0.1, 0.0), (place, 0.1, 0.0))
        commands.append(u)
    assert abs(commands[0]) < 1e-12
    assert max(abs(np.diff(commands))) < 0.02
    assert commands[-1] > 0.1


@pytest.mark.parametrize("name", INTEGRATING)
def test_integrators_stop_while_saturated_and_pushing_further(name: str) -> None:
    controller = built(name, limit=0.02, start_time=0.0)
    state = controller.initial_state()
    integrals = []
    for _ in range(500):
        state, u = controller.step(state, (0.05, 0.0, 0.0), (0.0, 0.0, 0.0))
        integrals.append(state[HEAD:].copy())
    assert u == 0.02
    np.testing.assert_array_equal(integrals[-1], integrals[0])
    _, back = controller.step(state, (0.0, 0.0, 0.0), (0.001, 0.0, 0.0))
    assert back <= 0.0  # leaves the limit at once


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_compiled_law_equals_plain_python(name: str) -> None:
    step, parameters = kernel_of(CONTROLLERS[name], "step"), load_variant("controller", name, CONTROLLERS)[1]
    p = records(CONTROLLERS, parameters).view(np.recarray)[0]
    state = np.full(parameters.states, 1e-3)
    reference, estimate = np.array([0.01, 0.1, 1.0]), np.array([0.011, 0.08, 1.5])
    plain = getattr(step, "py_func", step)
    compiled = step(state, p, reference, estimate, 0.1, DT)
    np.testing.assert_array_equal(compiled[0], plain(state, p, reference, estimate, 0.1, DT)[0])
    assert compiled[1] == plain(state, p, reference, estimate, 0.1, DT)[1]


def test_unknown_controller_names_the_known_ones() -> None:
    with pytest.raises(UnknownName, match="super_twisting"):
        Controller("super_twist", load_variant("controller", "none", CONTROLLERS)[1], DT)


def test_parameters_of_another_controller_are_refused() -> None:
    with pytest.raises(ShakeError, match="cannot use"):
        Controller("none", load_variant("controller", "sliding_mode", CONTROLLERS)[1], DT)


def test_model_that_is_named_must_be_handed_over() -> None:
    kind, parameters = load_variant("controller", "super_twisting", CONTROLLERS)
    with pytest.raises(ShakeError, match="bergamo"):
        Controller(kind, parameters.replace(model="bergamo"), DT)


@pytest.mark.parametrize("sample_time", [0.0, -1.0, math.nan])
def test_sample_time_must_be_positive(sample_time: float) -> None:
    kind, parameters = load_variant("controller", "none", CONTROLLERS)
    with pytest.raises(OutOfBounds, match="sample_time"):
        Controller(kind, parameters, sample_time)


def test_feedforward_pi_is_its_difference_equation() -> None:
    controller = built("feedforward_pi", start_time=0.0)
    state, _ = controller.step(controller.initial_state(), (0.0, 0.0, 0.0), (0.002, 0.0, 0.0))
    _, u = controller.step(state, (0.01, 0.1, 0.0), (0.011, 0.3, 5.0))
    # (6.40) by hand: e = 0.001, ∫e = (0.002 + 0.001)·dt
    assert u == pytest.approx(-25.005 * 0.001 - 0.453 * 0.003 * DT + 1.52 * 0.1)


def test_super_twisting_is_its_difference_equation() -> None:
    controller = built("super_twisting", start_time=0.0)
    _, u = controller.step(controller.initial_state(), (0.01, 0.1, 0.0), (0.011, 0.09, 0.5))
    s = 133.37 * 0.001 * DT + 4891.1 * 0.001 + 149.0 * (-0.01) + 1.24 * 0.5
    b_0 = 1.24 * 6991.0
    assert u == pytest.approx((-199.48 * math.sqrt(s) * math.tanh(1.84 * s) - 5.1 * DT) / b_0 + 1.3 * 0.1)


@pytest.mark.parametrize("estimate", [(0.011, 0.08, 1.5), (0.0, 0.3, -4.0), (-0.01, -0.2, 0.0)])
def test_sliding_mode_gives_the_surface_the_rate_it_demands(estimate: tuple[float, float, float]) -> None:
    # on the reduced model, with the reference's jerk zero: Ṡ = −K_s tanh(α_1 S)
    _, p = load_variant("controller", "sliding_mode", CONTROLLERS)
    controller = built("sliding_mode", start_time=0.0)
    reference, z = np.array([0.01, 0.1, 1.0]), np.array(estimate)
    state, u = controller.step(controller.initial_state(), reference, z)
    assert abs(u) < 1.0
    b1, b2, b3, b4, b5 = p.beta1, p.beta2, p.beta3, p.beta4, p.beta5
    jerk = b1 * z[1] + b2 * z[2] + b3 * u + abs(u) * (b4 * z[2] + b5 * z[1])
    e = z - reference
    surface = p.surface_integral * state[HEAD] + p.surface_position * e[0]
    surface += p.surface_velocity * e[1] + p.surface_acceleration * e[2]
    rate = p.surface_integral * e[0] + p.surface_position * e[1] + p.surface_velocity * e[2]
    rate += p.surface_acceleration * jerk
    assert rate == pytest.approx(-p.reaching_gain * math.tanh(p.reaching_slope * surface), abs=1e-6)


def test_super_twisting_reaches_its_surface_under_a_constant_disturbance() -> None:
    # reduced model, its own states: the twisting integral takes the disturbance up
    _, p = load_variant("controller", "super_twisting", CONTROLLERS)
    beta = beta_of(load_variant("controller", "sliding_mode", CONTROLLERS)[1])
    controller = built("super_twisting", start_time=0.0, twisting_gain=400.0)
    z, state = np.array([0.005, 0.0, 0.0]), controller.initial_state()
    for _ in range(8000):
        state, u = controller.step(state, (0.0, 0.0, 0.0), z)
        z = reduced.advance(z, beta, u, 100.0, DT)
    surface = p.surface_integral * state[HEAD] + p.surface_position * z[0]
    surface += p.surface_velocity * z[1] + p.surface_acceleration * z[2]
    assert abs(surface) < 0.2
    assert u == pytest.approx(-100.0 / beta["beta3"], rel=0.05)


@pytest.mark.parametrize("after", [n for n in CONFIGURATIONS if n != "none"])
@pytest.mark.parametrize("before", [*LAWS, "super_twisting_tuned"])
def test_switch_between_controllers_makes_no_bump(before: str, after: str) -> None:
    # a table that lags the sine a little; the command must not leave its own course by more than 2 % of the limit
    def motion(k: int) -> np.ndarray:
        phase = 4.0 * math.pi * k * DT
        return 0.02 * np.array(
            [math.sin(phase), 4.0 * math.pi * math.cos(phase), -(16.0 * math.pi**2) * math.sin(phase)]
        )

    old, new = built(before), built(after)
    state, commands = old.initial_state(), []
    for k in range(1200):
        if k == 1000:
            state = switch(old, state, new, commands[-1], 0.2)
        state, u = (old if k < 1000 else new).step(state, motion(k), motion(k - 4))
        commands.append(u)
    assert commands[1000] == pytest.approx(commands[999], abs=1e-9)
    assert max(abs(np.diff(commands[990:1200]))) < 0.02


def test_switch_keeps_the_virtual_table_going() -> None:
    model = load_table("bergamo")
    kinds = [load_variant("controller", n, CONTROLLERS) for n in ("feedforward_pi_tuned", "super_twisting_tuned")]
    old, new = (Controller(kind, parameters, DT, model) for kind, parameters in kinds)
    state = old.initial_state()
    for k in range(30):
        state, u = old.step(state, (1e-4 * k, 0.1, 0.0), (1e-4 * k, 0.1, 0.0))
    taken = switch(old, state, new, u, 0.2)
    np.testing.assert_array_equal(taken[new.law_size :], state[old.law_size :])
    fresh = switch(built("none"), built("none").initial_state(), new, u, 0.2)
    assert not fresh[new.law_size :].any()
