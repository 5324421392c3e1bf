"""The two-stage valve against its parts' closed forms, the second-order model, and in the plant."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from valve_of_the_sheet import SUPPLY, TANK, rates_of_the_sheet, step

from shake_ros.packing import record
from shake_ros.physics.plant.simulation import run
from shake_ros.physics.plant.table import Table
from shake_ros.physics.valve import VALVES, detailed, linear_response, linearised, valve_response
from shake_ros.settings import load_table, load_variant

NO_LOAD = (103.5e5, 103.5e5, 0.0, 0.0)
DT = 1e-4


@pytest.fixture(scope="module")
def valve():
    return load_variant("valve", "detailed", VALVES)[1]


@pytest.fixture(scope="module")
def simplified():
    return load_table("bergamo").valve


def loop_width(valve, amplitude=0.05):
    """Command between the two crossings of the spool through zero, up and down, on a slow triangle [-]."""
    n = 8000
    triangle = amplitude * (2.0 * np.abs(2.0 * ((np.arange(2 * n) / n + 0.25) % 1.0) - 1.0) - 1.0)
    spool = valve_response(valve, triangle, 1e-3 / 8.0, SUPPLY, TANK)[n:]
    command = triangle[n:]
    period = np.ones(50) / 50.0
    smooth = np.convolve(spool, period, "same")
    rising = np.gradient(command) > 0.0
    near = np.abs(smooth) < 0.1 * amplitude
    return float(command[rising & near].mean() - command[~rising & near].mean())


def test_at_rest_all_flows_balance(valve):
    p = record("valve", VALVES, valve)
    rest = detailed.valve_at_rest(p, SUPPLY, TANK)
    rates = np.zeros(8)
    detailed.valve_rates(p, rest, 0.0, SUPPLY, TANK, NO_LOAD, rates)
    assert TANK < rest[detailed.OUTLET] < rest[detailed.NOZZLE_1] < SUPPLY
    assert np.abs(rates[[detailed.FLAPPER_RATE, detailed.SPOOL_RATE]]).max() < 1e-9
    assert np.abs(rates).max() < 100.0  # Pa/s


def test_torque_motor_gives_the_published_gain_at_small_current(valve):
    p = record("valve", VALVES, valve)
    k_t = detailed.MAGNETIC_CONSTANT * 1e-5 * 14.5e-3 * 300.0 * 4000.0 / 0.25e-3**2  # μ0 A_g l_a M_0 N/g²
    assert detailed.motor_torque(p, 1e-4, 0.0) == pytest.approx(k_t * 1e-4, rel=1e-9)
    assert detailed.motor_torque(p, 0.0, 1e-6) > 0.0  # the magnets pull the armature on


def test_ball_clearance_leaves_the_spring_without_force(valve):
    p = record("valve", VALVES, valve.replace(ball_clearance=1e-5))
    assert detailed.feedback_torque(p, 0.0, 0.9e-5) == 0.0
    assert detailed.feedback_torque(p, 0.0, 3e-5) == pytest.approx(268.6 * 2e-5)
    assert detailed.feedback_torque(p, 0.0, -3e-5) == pytest.approx(-268.6 * 2e-5)


def test_the_valve_is_stable_and_its_slow_pair_is_that_of_the_second_order_model(valve):
    poles = np.linalg.eigvals(linearised(valve, SUPPLY, TANK)[0])
    assert poles.real.max() < 0.0
    frequencies = np.array([5.0, 50.0, 100.0, 150.0, 200.0, 250.0])
    ratio = linear_response(valve, frequencies, SUPPLY, TANK) / linear_response(
        load_table("bergamo").valve, frequencies, SUPPLY, TANK
    )
    np.testing.assert_allclose(np.abs(ratio), 1.0, atol=0.06)
    np.testing.assert_allclose(np.degrees(np.angle(ratio)), 0.0, atol=3.5)


def test_small_steps_agree_with_the_second_order_model(valve, simplified):
    smooth = simplified.replace(hysteresis=0.0)
    ours = valve_response(valve, step(0.05), DT, SUPPLY, TANK)
    theirs = valve_response(smooth, step(0.05), DT, SUPPLY, TANK)
    assert np.abs(ours - theirs).max() < 0.05 * 0.06
    assert ours[-1] == pytest.approx(0.05, rel=0.02)


def test_simplified_step_is_the_closed_form(simplified):
    omega, d = simplified.natural_frequency, simplified.damping
    result = valve_response(simplified.replace(hysteresis=0.0), np.full(100, 0.1), DT, SUPPLY, TANK)
    t = np.arange(100) * DT
    w_d = omega * math.sqrt(1.0 - d * d)
    closed = 0.1 * (1.0 - np.exp(-d * omega * t) * (np.cos(w_d * t) + d * omega / w_d * np.sin(w_d * t)))
    np.testing.assert_allclose(result, closed, atol=2e-5)


def test_large_steps_are_limited_by_the_pilot_flow(valve):
    full = valve_response(valve, step(1.0), DT, SUPPLY, TANK)
    small = valve_response(valve, step(0.05), DT, SUPPLY, TANK)
    assert np.diff(full).max() < 0.7 * 20.0 * np.diff(small).max()
    assert full.max() <= 1.0
    pilot = 0.61 * 3.1e-8 * math.sqrt(2.0 * (SUPPLY - TANK) / 870.0)  # more than a restriction can ever pass
    assert np.diff(full).max() / DT < pilot / 1.68e-5 / 0.38e-3


def test_ball_clearance_and_spool_friction_make_hysteresis_and_dither_lessens_it(valve):
    clean = abs(loop_width(valve))
    assert loop_width(valve.replace(ball_clearance=2e-6)) > clean + 8e-4
    rubbing = valve.replace(spool_friction=20.0)
    wide = loop_width(rubbing)
    assert wide > clean + 5e-3
    assert loop_width(rubbing.replace(dither_amplitude=0.2)) < 0.2 * wide


def test_electrical_feedback_replaces_the_spring(valve):
    electrical = valve.replace(feedback_stiffness=0.0, electrical_gain=1.0, flow_force_stiffness=0.0)
    spool = valve_response(electrical, step(0.2, 2000), DT, SUPPLY, TANK)
    assert spool[-1] == pytest.approx(0.2, rel=0.05)


@pytest.mark.parametrize(
    "changes",
    [{}, {"coil_time": 2e-4}, {"ball_clearance": 2e-6}, {"electrical_gain": 0.7, "feedback_stiffness": 0.0}],
    ids=["mechanical feedback", "inductive coil", "worn ball", "electrical feedback"],
)
def test_rates_are_those_of_the_equation_sheet(valve, changes):
    valve = valve.replace(**changes)
    p, out, draw = record("valve", VALVES, valve), np.zeros(8), np.random.default_rng(3)
    for _ in range(50):
        pressures = np.array([0.6, 0.6, 0.15]) * SUPPLY * draw.uniform(0.8, 1.2, 3)
        x_f, x_s = draw.uniform(-0.9, 0.9, 2) * (valve.nozzle_gap, valve.spool_stroke)
        i, v_f, v_s, u = draw.uniform(-1.0, 1.0, 4) * (valve.amplifier_gain, 0.05, 0.5, 1.0)
        y = np.array([i, x_f, v_f, *pressures, x_s, v_s])
        detailed.valve_rates(p, y, u, SUPPLY, TANK, NO_LOAD, out)
        np.testing.assert_allclose(out, rates_of_the_sheet(valve, y, u, SUPPLY, TANK), rtol=1e-6)


def test_fixed_steps_are_within_a_thousandth_of_radau(valve):
    p = record("valve", VALVES, valve)
    rest = detailed.valve_at_rest(p, SUPPLY, TANK)

    def rates(_t, y):
        return rates_of_the_sheet(valve, y, 0.3, SUPPLY, TANK)

    t = np.arange(60) * DT
    scale = np.array([1e-6, 1e-12, 1e-9, 1.0, 1.0, 1.0, 1e-10, 1e-7])
    tight = solve_ivp(rates, (0.0, t[-1]), rest, method="Radau", t_eval=t, rtol=1e-8, atol=scale).y[detailed.SPOOL]
    ours = valve_response(valve, np.full(60, 0.3), DT, SUPPLY, TANK)
    assert np.abs(ours - tight / valve.spool_stroke).max() < 1e-3 * 0.3


def test_both_valves_drive_the_same_table(valve):
    table = load_table("bergamo")
    changed = table.with_sections(valve=valve)
    u = 0.3 * np.sin(2.0 * np.pi * 2.0 * np.arange(1000) * 1e-3)
    one, other = run(table, u, 1e-3), run(changed, u, 1e-3)
    assert np.std(one[:, 6] - other[:, 6]) < 0.02 * np.std(one[:, 6])
    assert np.std(one[:, 1] - other[:, 1]) < 0.02 * np.std(one[:, 1])


def test_the_table_with_the_detailed_valve_survives_its_file_and_steps_like_a_run(valve):
    table = load_table("bergamo").with_sections(valve=valve)
    again = table.layout.table(table.to_mapping(), "saved")
    assert again.valve == valve
    node = Table(again)
    state = node.initial_state()
    u = 0.2 * np.sin(np.arange(30))
    positions = []
    for k, command in enumerate(u):
        positions.append(node.measure(state, k).truth_position)
        state = node.advance(state, command)
    np.testing.assert_array_equal(positions, run(table, u, 1e-3)[:, 0])
