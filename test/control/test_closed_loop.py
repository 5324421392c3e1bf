"""Plant, observer, controller and reference together: what the thesis's laws reach, and what the model adds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from stepped_loop import simulate_closed_loop

from shake_ros.control.closed_loop import ClosedLoop, command_travel, normalised_cost, tracking_cost, tune
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.laws.virtual_table import VirtualTable
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.control.reference.program import Program
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import ShakeError
from shake_ros.recordings.reference_file import build_program
from shake_ros.settings import load_table, load_variant

DT = 0.001
EFFECTS: dict[str, dict[str, float]] = {
    "spool_deadband": {"effects.spool_deadband.width": 0.03},
    "valve_null_shift": {"effects.valve_null_shift.offset": 0.03},
    "soft_zone": {"effects.soft_zone.depth": 0.8},
    "asymmetric_flow_gain": {"effects.asymmetric_flow_gain.asymmetry": 0.2},
    "specimen_resonance": {"effects.specimen_resonance.mass": 150.0, "effects.specimen_resonance.frequency": 8.0},
    "payload_error": {"effects.payload_error.mass": 300.0},
    "command_delay": {"effects.command_delay.delay": 0.004},
}
SAMPLES = 3500


@pytest.fixture(scope="module")
def declared() -> TableParameters:
    return load_table("bergamo")


@pytest.fixture(scope="module")
def earthquake() -> Program:
    return build_program("earthquake", DT)


@pytest.fixture(scope="module")
def sine() -> Program:
    return build_program("sine_20mm_2hz", DT)


def controller(name: str, model: TableParameters | None = None, **changes: float) -> Controller:
    kind, parameters = load_variant("controller", name, CONTROLLERS)
    return Controller(kind, parameters.replace(**changes), DT, model)


def observer(name: str, model: TableParameters | None = None) -> Observer:
    kind, parameters = load_variant("observer", name, OBSERVERS)
    return Observer(kind, parameters, DT, model)


class AsPrinted:
    """(6.48), (6.49) with their misprints, to show what they cost."""

    def __init__(self) -> None:
        self.sample_time = DT
        self.p = load_variant("controller", "sliding_mode", CONTROLLERS)[1]

    def initial_state(self) -> NDArray[np.float64]:
        return np.zeros(1)

    def step(self, state: Any, r: Any, z: Any) -> tuple[NDArray[np.float64], float]:
        p, e = self.p, z - r
        integral = state + e[0] * DT
        k = p.surface_integral, p.surface_position, p.surface_velocity, p.surface_acceleration
        s = k[0] * integral[0] + k[1] * e[0] + k[2] * e[1] + k[3] * e[2]
        printed = p.beta1 * r[1] + p.beta2 * r[2] + 4.7 * (p.beta4 * z[2] + p.beta5 * z[1])
        u = -k[0] * e[0] - (k[3] * p.beta1 + k[1]) * e[1] - (k[3] * p.beta2 + k[2]) * e[2] - printed
        u -= p.reaching_gain * math.tanh(p.reaching_slope * s)
        return integral, float(np.clip(u / (k[3] * p.beta3), -1.0, 1.0))


def test_sliding_mode_as_derived_beats_the_print(declared: TableParameters, sine: Program) -> None:
    # 2 Hz, 20 mm, perfect states: about 2.2 % as derived and 13.5 % as printed
    table = Table(declared, DT)
    derived = simulate_closed_loop(table, None, controller("sliding_mode"), sine, SAMPLES).tracking_error(1500)
    printed: Any = AsPrinted()
    wrong = simulate_closed_loop(table, None, printed, sine, SAMPLES).tracking_error(1500)
    assert derived[0] == pytest.approx(0.022, abs=0.004)
    assert wrong[0] == pytest.approx(0.135, abs=0.015)


@pytest.mark.parametrize("effect", ["none", *EFFECTS])
@pytest.mark.parametrize("name", ["super_twisting", "super_twisting_tuned"])
def test_super_twisting_stays_stable_whatever_the_table_hides(
    name: str, effect: str, declared: TableParameters, earthquake: Program
) -> None:
    # position alone is measured, with noise and steps; the command arrives one sample late
    table = Table(declared.with_values(EFFECTS.get(effect, {})), DT, seed=3)
    run = simulate_closed_loop(table, observer("linear_bergamo"), controller(name), earthquake, SAMPLES, delay=1)
    assert run.tracking_error()[0] < 0.10
    assert np.max(np.abs(run.command)) < 0.8
    assert command_travel(run) < 8.0


@pytest.mark.parametrize("effect", EFFECTS)
def test_tuned_super_twisting_tracks_better_than_the_printed_gains(
    effect: str, declared: TableParameters, earthquake: Program
) -> None:
    table = Table(declared.with_values(EFFECTS[effect]), DT, seed=3)
    error = [
        simulate_closed_loop(
            table, observer("linear_bergamo"), controller(name), earthquake, SAMPLES, delay=1
        ).tracking_error()[0]
        for name in ("super_twisting", "super_twisting_tuned")
    ]
    assert error[1] < 0.7 * error[0]


@pytest.mark.parametrize("effect", EFFECTS)
def test_extended_model_brings_the_position_error_below_one_and_a_half_percent(
    effect: str, declared: TableParameters, earthquake: Program
) -> None:
    truth = declared.with_values(EFFECTS[effect])
    errors = {}
    for label, model in (("declared", declared), ("extended", truth)):
        law = controller("super_twisting_tuned", model)
        run = simulate_closed_loop(Table(truth, DT, seed=3), observer("model", model), law, earthquake, SAMPLES)
        errors[label] = run.tracking_error()
    assert errors["extended"][0] < 0.015
    assert errors["extended"][1] < 0.7 * errors["declared"][1]


def test_virtual_table_follows_the_reference_through_a_dead_band(
    declared: TableParameters, earthquake: Program
) -> None:
    virtual = VirtualTable(declared.with_values(EFFECTS["spool_deadband"]), DT, 100.0, 0.004, 1.0)
    state, wanted, found = virtual.initial_state(), np.empty((2500, 3)), np.empty((2500, 3))
    for k in range(2500):
        wanted[k] = earthquake.at(k)
        state, _, found[k] = virtual.step(state, wanted[k])
    error = np.sqrt(np.mean((found - wanted) ** 2, axis=0)) / np.std(wanted, axis=0)
    assert error[0] < 0.002
    assert error[1] < 0.01
    assert error[2] < 0.06


def test_feedforward_goes_slowly_through_backlash(declared: TableParameters, earthquake: Program) -> None:
    worn = declared.with_values({"effects.coupling_backlash.gap": 1.4e-4, "effects.coupling_backlash.stiffness": 3e8})
    wanted = np.array([earthquake.at(k) for k in range(300)])
    commands = [VirtualTable(table, DT, 100.0, 0.002, 1.0).follow(wanted)[0] for table in (declared, worn)]
    np.testing.assert_array_equal(commands[0], commands[1])
    assert np.max(np.abs(commands[1])) < 0.9


@pytest.mark.parametrize("delay", [0.0, 0.0025, 0.005])
def test_loop_that_predicts_through_the_dead_time_is_better_than_one_that_does_not(
    delay: float, declared: TableParameters, earthquake: Program
) -> None:
    # the table's own dead time, found, and one sample of the loop's
    truth = declared.with_values({"effects.command_delay.delay": delay})
    errors = []
    for predict in (False, True):
        kind, parameters = load_variant("observer", "model", OBSERVERS)
        seer = Observer(kind, parameters.replace(predict=predict, loop_delay=DT), DT, truth)
        law = controller("super_twisting_tuned", truth, predict=predict, loop_delay=DT)
        run = simulate_closed_loop(Table(truth, DT, seed=3), seer, law, earthquake, SAMPLES, delay=1)
        errors.append(run.tracking_error())
    assert np.all(errors[1] <= errors[0])
    assert errors[1][2] < 0.06


def test_estimate_that_is_predicted_is_that_of_the_sample_in_which_the_command_acts(
    declared: TableParameters,
) -> None:
    # without noise and with a model that is the table, the prediction is the motion to come, fraction included
    quiet = {"sensors.position_noise": 0.0, "sensors.position_bits": 0, "effects.command_delay.delay": 0.003}
    truth = declared.with_values(quiet)
    kind, parameters = load_variant("observer", "model", OBSERVERS)
    whole = Observer(kind, parameters.replace(predict=True), DT, truth)
    part = Observer(
        kind, parameters.replace(predict=True), DT, truth.with_values({"effects.command_delay.delay": 0.0024})
    )
    commands = 0.2 * np.sin(2.0 * np.pi * 3.0 * np.arange(1200) * DT)
    for seer, delay in ((whole, 3.0), (part, 2.4)):
        plant = Table(truth.with_values({"effects.command_delay.delay": delay * DT}), DT)
        state, motion, estimates = plant.initial_state(0.0), np.empty((1200, 3)), np.empty((1200, 3))
        seen = seer.initial_state(0.0)
        for k in range(1200):
            m = plant.measure(state, k)
            motion[k] = m.truth_position, m.truth_velocity, m.truth_acceleration
            seen, estimates[k] = seer.step(seen, m.position, commands[k - 1] if k else 0.0)
            state = plant.advance(state, commands[k])
        at = np.arange(300, 1100)
        there = [np.interp(at + delay, np.arange(1200), motion[:, i]) for i in range(3)]
        np.testing.assert_allclose(estimates[at, 0], there[0], atol=2e-6)
        np.testing.assert_allclose(estimates[at, 1], there[1], atol=2e-3)


def test_prediction_without_a_model_is_refused() -> None:
    with pytest.raises(ShakeError, match="predict needs a model"):
        controller("super_twisting_tuned", predict=True)


def test_virtual_table_starts_where_the_reference_is(declared: TableParameters) -> None:
    virtual = VirtualTable(declared, DT, 100.0, 0.004, 1.0)
    _, u, place = virtual.step(virtual.initial_state(), (0.05, 0.0, 0.0))
    assert place[0] == 0.05
    assert abs(u) < 0.02


def test_virtual_table_leaves_its_state_untouched(declared: TableParameters) -> None:
    virtual = VirtualTable(declared, DT, 100.0, 0.004, 1.0)
    state, _, _ = virtual.step(virtual.initial_state(), (0.0, 0.1, 0.0))
    before = state.copy()
    first, second = virtual.step(state, (0.0, 0.1, 1.0)), virtual.step(state, (0.0, 0.1, 1.0))
    np.testing.assert_array_equal(state, before)
    np.testing.assert_array_equal(first[0], second[0])


def test_virtual_table_along_a_whole_reference_is_the_same_as_step_by_step(
    declared: TableParameters, earthquake: Program
) -> None:
    virtual = VirtualTable(declared.with_values(EFFECTS["command_delay"]), DT, 100.0, 0.004, 1.0)
    commands, motion = virtual.follow(earthquake.samples(1500, 200))
    state = virtual.initial_state()
    for k in range(200):
        state, u, place = virtual.step(state, earthquake.at(1500 + k))
        assert u == commands[k]
        np.testing.assert_array_equal(place, motion[k])


def test_two_runs_of_the_loop_are_the_same_to_the_bit(declared: TableParameters, earthquake: Program) -> None:
    runs = [
        simulate_closed_loop(
            Table(declared, DT, seed=7),
            observer("model", declared),
            controller("super_twisting_tuned", declared),
            earthquake,
            600,
        )
        for _ in range(2)
    ]
    np.testing.assert_array_equal(runs[0].command, runs[1].command)
    np.testing.assert_array_equal(runs[0].truth, runs[1].truth)


def test_loop_of_different_sample_times_is_refused(declared: TableParameters, earthquake: Program) -> None:
    with pytest.raises(ShakeError, match="sample times"):
        simulate_closed_loop(Table(declared, 0.002), None, controller("none"), earthquake, 10)


def still_run(error: float) -> ClosedLoop:
    """A run of two seconds whose position is off by `error` and whose reference has moved by 1 m from the start."""
    reference = np.ones((2000, 3)) * [1.0, 0.0, 0.0]
    reference[0, 0] = 0.0
    truth = reference + np.array([error, 0.0, 0.0])
    return ClosedLoop(DT, reference, truth, truth, np.linspace(0.0, 1.0, 2000), np.zeros((2000, 5)))


def test_tuning_functional_is_the_integral_of_the_squares() -> None:
    # (6.42) by hand: 0.1² m² over 2 s; the table at rest would have 1² m² over 1.999 s
    run = still_run(0.1)
    assert tracking_cost(run) == pytest.approx(0.02)
    assert command_travel(run) == pytest.approx(1.0 / 1.999)
    assert normalised_cost(run, 0.0) == pytest.approx(math.sqrt(0.02 / 1.999))


def test_tuning_finds_the_gain_of_least_cost_and_keeps_its_sign() -> None:
    counts: list[int] = []
    gains, cost = tune(
        {"gain": -3.0},
        lambda g: normalised_cost(still_run(g["gain"] + 1.5), 0.0),
        evaluations=80,
        done=lambda count, best: counts.append(count),
    )
    assert gains["gain"] == pytest.approx(-1.5, rel=1e-3)
    assert cost < 1e-2
    assert counts == list(range(1, len(counts) + 1))


def test_tuning_steps_back_from_gains_that_are_refused_or_lose_the_loop() -> None:
    def cost(gains: dict[str, float]) -> float:
        if gains["gain"] > 2.0:
            raise ShakeError("gain is outside 0 … 2")
        return math.nan if gains["gain"] > 1.8 else abs(gains["gain"] - 1.7)

    gains, least = tune({"gain": 1.5}, cost, evaluations=60)
    assert gains["gain"] == pytest.approx(1.7, rel=1e-2)
    assert least < 0.02


def test_gain_of_zero_cannot_be_tuned() -> None:
    with pytest.raises(ShakeError, match=r"a gain of zero cannot be tuned: \['b'\]"):
        tune({"a": 1.0, "b": 0.0}, lambda gains: 0.0, evaluations=5)
