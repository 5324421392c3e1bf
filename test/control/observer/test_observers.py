"""Contracts that every observer keeps, and what each is for."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shake_ros.control.observer import OBSERVERS, linear, runner
from shake_ros.control.observer.runner import ABSENT, Observer
from shake_ros.packing import kernel_of, records
from shake_ros.physics.plant import reduced
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import ShakeError, UnknownName
from shake_ros.settings import config_folder, load_table, load_variant

DT = 0.001
Array = NDArray[np.float64]
CONFIGURATIONS = sorted(p.stem for p in (config_folder() / "observer").glob("*.yaml"))


def built(name: str, **changes: float) -> Observer:
    kind, parameters = load_variant("observer", name, OBSERVERS)
    model = load_table(parameters.model) if parameters.carries_table else None
    return Observer(kind, parameters.replace(**changes), DT, model)


def excitation(samples: int) -> Array:
    t = np.arange(samples) * DT
    return 0.25 * np.sin(2.0 * np.pi * 2.0 * t) + 0.1 * np.sin(2.0 * np.pi * 5.0 * t)


def beta_of(parameters: Any) -> Any:
    """The reduced model's β as the record that `reduced.advance` takes."""
    return records(OBSERVERS, parameters)[0]


def reduced_motion(beta: Any, commands: Array) -> Array:
    states = np.zeros((len(commands), 3))
    for k in range(1, len(commands)):
        states[k] = reduced.advance(states[k - 1], beta, commands[k - 1], 0.0, DT)
    return states


def observe(observer: Observer, positions: Array, commands: Array) -> Array:
    state = observer.initial_state(positions[0])
    estimates = np.empty((len(positions), 3))
    for k, position in enumerate(positions):
        state, estimates[k] = observer.step(state, position, commands[k - 1] if k else 0.0)
    return estimates


def errors(found: Array, wanted: Array) -> Array:
    error: Array = np.sqrt(
        np.mean((found - wanted) ** 2, axis=0) / np.mean((wanted - wanted.mean(axis=0)) ** 2, axis=0)
    )
    return error


def noisy(positions: Array, seed: int = 1) -> Array:
    """8 µm of noise and 16 bits over 300 mm."""
    step = 0.3 / 2**16
    dirty: Array = (
        np.round((positions + 8e-6 * np.random.RandomState(seed).standard_normal(len(positions))) / step) * step
    )
    return dirty


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_observer_at_rest_stays_at_rest(name: str) -> None:
    observer = built(name)
    state = observer.initial_state(0.02)
    for _ in range(50):
        state, estimate = observer.step(state, 0.02, 0.0)
    # a carried table settles its chamber pressures under the leakage, as the real one does
    small = [1e-5, 1e-3, 0.1] if observer.parameters.carries_table else [1e-9, 1e-9, 1e-9]
    assert np.all(np.abs(estimate - [0.02, 0.0, 0.0]) < small)


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_observer_leaves_its_input_untouched_and_repeats_itself(name: str) -> None:
    observer = built(name)
    state = observer.initial_state(0.0)
    before = state.copy()
    first = observer.step(state, 1e-4, 0.3)
    second = observer.step(state, 1e-4, 0.3)
    np.testing.assert_array_equal(state, before)
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])


@pytest.mark.parametrize("name", CONFIGURATIONS)
@pytest.mark.parametrize(("position", "command"), [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0)])
def test_observer_refuses_what_is_not_a_number(name: str, position: float, command: float) -> None:
    observer = built(name)
    with pytest.raises(ShakeError, match="not finite"):
        observer.step(observer.initial_state(0.0), position, command)


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_observer_stays_bounded_under_a_wild_measurement(name: str) -> None:
    # the sign terms saturate for two seconds and must let go afterwards
    observer = built(name)
    state = observer.initial_state(0.0)
    wild = np.random.RandomState(0).uniform(-0.05, 0.05, 2000)
    for k in range(2000):
        state, estimate = observer.step(state, wild[k], 0.5 * (-1.0) ** (k // 50))
    assert np.all(np.isfinite(estimate))
    for _ in range(6000):
        state, estimate = observer.step(state, 0.0, 0.0)
    assert abs(estimate[1]) < 0.05


def test_unknown_observer_names_the_known_ones() -> None:
    with pytest.raises(UnknownName, match="sliding_mode"):
        Observer("slidng_mode", load_variant("observer", "linear", OBSERVERS)[1], DT)


def test_parameters_of_another_observer_are_refused() -> None:
    with pytest.raises(ShakeError, match="cannot use"):
        Observer("sliding_mode", load_variant("observer", "linear", OBSERVERS)[1], DT)


def test_model_observer_without_its_table_is_refused() -> None:
    kind, parameters = load_variant("observer", "model", OBSERVERS)
    with pytest.raises(ShakeError, match="bergamo"):
        Observer(kind, parameters, DT)


@pytest.mark.parametrize("name", ["sliding_mode", "linear"])
def test_observer_is_exact_on_its_own_model_without_noise(name: str) -> None:
    beta = beta_of(load_variant("observer", name, OBSERVERS)[1])
    commands = excitation(2000)
    motion = reduced_motion(beta, commands)
    np.testing.assert_allclose(observe(built(name), motion[:, 0], commands), motion, atol=1e-8)


@pytest.mark.parametrize("name", ["sliding_mode", "linear"])
def test_observer_forgets_a_wrong_start(name: str) -> None:
    beta = beta_of(load_variant("observer", name, OBSERVERS)[1])
    commands = excitation(4000)
    motion = reduced_motion(beta, commands)
    late = observe(built(name), motion[300:, 0], commands[300:])  # starts at rest amid the motion, without the past
    assert errors(late[2000:], motion[2300:])[1] < 0.02


@pytest.mark.parametrize(("name", "velocity", "acceleration"), [("sliding_mode", 0.03, 0.15), ("linear", 0.03, 0.25)])
def test_velocity_and_acceleration_under_noise_and_quantisation(
    name: str, velocity: float, acceleration: float
) -> None:
    beta = beta_of(load_variant("observer", name, OBSERVERS)[1])
    commands = excitation(5000)
    motion = reduced_motion(beta, commands)
    found = errors(observe(built(name), noisy(motion[:, 0]), commands)[1000:], motion[1000:])
    assert found[1] < velocity
    assert found[2] < acceleration


def test_linear_observer_has_no_steady_error_under_a_null_shift() -> None:
    # a null shift is a constant jerk: the sliding-mode observer keeps an error, the disturbance state takes it up
    beta = beta_of(load_variant("observer", "linear", OBSERVERS)[1])
    commands = np.full(4000, 0.1)
    motion = reduced_motion(beta, commands + 0.02)
    found = observe(built("linear"), motion[:, 0], commands)
    assert found[-1, 1] == pytest.approx(motion[-1, 1], rel=1e-3)


def test_sliding_mode_feeds_a_stage_only_once_the_one_before_has_reached_its_surface() -> None:
    law = records(OBSERVERS, load_variant("observer", "sliding_mode", OBSERVERS)[1])
    step = runner.step_of("sliding_mode")

    def fed(position: float) -> Array:
        estimate = np.empty(3)
        step(np.zeros(3), law, runner.NO_MODEL, np.array([position, *ABSENT]), 0.0, DT, runner.work(), estimate)
        return estimate

    far = fed(1e-3)  # 1 mm: far beyond dt λ_1 = 30 µm
    assert far[0] == pytest.approx(0.03 * DT)
    assert far[1] == far[2] == 0.0
    near = fed(10e-6)  # first surface reached: the position is the measurement
    assert near[0] == pytest.approx(10e-6)
    assert near[1] == pytest.approx(2.5 * DT)  # second saturated
    assert near[2] == 0.0
    nearest = fed(2e-6)  # 2 µm/ms is within dt λ_2: all three are fed
    assert nearest[1] == pytest.approx(2e-3)
    assert nearest[2] == pytest.approx(5.0 * DT)


def test_sliding_mode_converges_to_the_finely_stepped_explicit_observer() -> None:
    # (6.38) of a pure integrator chain with a velocity error below λ_1: both reach ẑ_1 = z_1 in finite time
    kind, parameters = load_variant("observer", "sliding_mode", OBSERVERS)
    observer = Observer(kind, parameters, DT)
    state = observer.initial_state(1e-3)
    reached = None
    for k in range(200):
        state, estimate = observer.step(state, 0.0, 0.0)
        if reached is None and abs(estimate[0]) < 1e-12:
            reached = k + 1
    fine, steps = 1e-3, 0
    while fine > 0.0:
        fine -= parameters.lambda1 * 1e-6
        steps += 1
    assert reached is not None
    assert reached == math.ceil(steps * 1e-6 / DT - 1e-6)


def test_kalman_gain_is_the_limit_of_the_riccati_recursion() -> None:
    _, parameters = load_variant("observer", "linear", OBSERVERS)
    matrix = linear.extended_transition(parameters, DT)
    unrest = np.diag([0.0, 0.0, parameters.jerk_noise**2, parameters.disturbance_noise**2]) * DT
    noise = parameters.position_noise**2
    covariance = np.diag([1e-10, 1e-6, 1e-2, 1e2])
    for _ in range(20_000):
        predicted = matrix @ covariance @ matrix.T + unrest
        gain = predicted[:, 0] / (predicted[0, 0] + noise)
        covariance = predicted - np.outer(gain, predicted[0])
        covariance = 0.5 * (covariance + covariance.T)
    np.testing.assert_allclose(linear.kalman_gain(parameters, DT), gain, rtol=1e-3)


def test_model_observer_sees_through_effects_that_its_table_has() -> None:
    table = load_table("bergamo").with_values({"effects.spool_deadband.width": 0.03, "effects.soft_zone.depth": 0.6})
    kind, parameters = load_variant("observer", "model", OBSERVERS)
    commands = excitation(2500)
    plant = Table(table, DT, seed=4)
    state, positions, motion = plant.initial_state(), np.empty(2500), np.empty((2500, 3))
    for k in range(2500):
        m = plant.measure(state, k)
        positions[k], motion[k] = m.position, (m.truth_position, m.truth_velocity, m.truth_acceleration)
        state = plant.advance(state, commands[k])
    knowing = errors(observe(Observer(kind, parameters, DT, table), positions, commands)[500:], motion[500:])
    declared = errors(
        observe(Observer(kind, parameters, DT, load_table("bergamo")), positions, commands)[500:], motion[500:]
    )
    assert knowing[1] < 0.01
    assert knowing[2] < 0.1
    assert knowing[1] < 0.3 * declared[1]


def whole_run(observer: Observer, positions: Array, commands: Array) -> Array:
    """Estimates by the one compiled step."""
    state, space, estimates = observer.initial_state(positions[0]), runner.work(), np.empty((len(positions), 3))
    for k, position in enumerate(positions):
        command = commands[k - 1] if k else 0.0
        measured = np.array([position, *ABSENT])
        runner.step_observer(state, *observer.compiled, measured, command, DT, space, estimates[k])
    return estimates


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_one_compiled_step_for_all_gives_the_numbers_of_the_face(name: str) -> None:
    commands = excitation(60)
    positions = 1e-3 * np.sin(np.arange(60) * 0.05)
    expected = observe(built(name), positions, commands)
    np.testing.assert_array_equal(whole_run(built(name), positions, commands), expected)
    np.testing.assert_array_equal(built(name).run(positions, commands), expected)


@pytest.mark.parametrize(
    ("positions", "commands", "reason"),
    [([0.0, 0.1], [0.0], "shape"), ([], [], "shape"), ([0.0, math.nan], [0.0, 0.0], "not finite")],
)
def test_run_refuses_series_that_do_not_fit(positions: list[float], commands: list[float], reason: str) -> None:
    with pytest.raises(ShakeError, match=reason):
        built("linear").run(np.array(positions), np.array(commands))


def test_every_observer_has_a_number_of_its_own_above_zero() -> None:
    codes = {member.code for member in OBSERVERS.values()}
    assert len(codes) == len(OBSERVERS)
    assert min(codes) > runner.NO_OBSERVER[0]["kind"] == 0.0


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_observer_continues_from_an_estimate(name: str) -> None:
    observer = built(name)
    estimate, command = np.array([0.01, 0.15, -1.2]), 0.24
    _, found = observer.step(observer.started(estimate, command), 0.01 + 0.15 * DT - 0.6 * DT**2, command)
    assert found[0] == pytest.approx(0.01 + 0.15 * DT, abs=2e-6)
    assert found[1] == pytest.approx(0.15 - 1.2 * DT, abs=2e-3)
    assert found[2] == pytest.approx(-1.2, abs=0.3)


@pytest.mark.parametrize("name", [name for name, member in OBSERVERS.items() if not member.carries_table])
def test_compiled_observer_equals_plain_python(name: str) -> None:
    observe, parameters = kernel_of(OBSERVERS[name], "observe"), load_variant("observer", name, OBSERVERS)[1]
    p = records(OBSERVERS, parameters, derived=parameters.derive(DT, None)).view(np.recarray)[0]
    plain = getattr(observe, "py_func", observe)
    results = []
    for function in (observe, plain):
        state, estimate = parameters.started(np.array([0.0, 0.1, 1.0]), 0.0, DT, None), np.empty(3)
        function(state, p, runner.NO_MODEL[0], np.array([2e-5, *ABSENT]), 0.1, DT, runner.work(), estimate)
        results.append(np.append(state, estimate))
    np.testing.assert_allclose(*results, rtol=1e-14)  # numba takes a whole power by multiplication
