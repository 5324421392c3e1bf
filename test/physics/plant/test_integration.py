"""The plant against the same model written a second time (benchmarks/plant/reference_model.py), under scipy's Radau."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.plant import reference_model as reference
from shake_ros.physics.plant.dormand_prince import PATH, STAGE, dormand_prince, spool_path, workspace
from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.right_hand_side import table_rates
from shake_ros.physics.plant.simulation import initial_state, run
from shake_ros.physics.plant.states import DECLARED, VELOCITY
from shake_ros.settings import load_table

SAMPLE = 0.001
DEPTHS = {"constant modulus": 0.0, "soft zone": 0.84}


def declared(depth: float):
    table = load_table("bergamo")
    return table.with_values({"effects.soft_zone.depth": depth}) if depth else table


@pytest.mark.parametrize("depth", DEPTHS.values(), ids=DEPTHS)
@pytest.mark.parametrize("name", ["0.7 at 2 Hz", "pulse"])
def test_many_small_steps_and_Radau_at_1e_9_are_the_same_solution(name: str, depth: float) -> None:
    commands = reference.RUNS[name][80:130] if name == "pulse" else reference.RUNS[name][:50]
    constants = reference.constants(depth)
    tight = reference.radau(commands, SAMPLE, constants)
    assert reference.nrmse(tight, reference.fine_steps(commands, SAMPLE, constants)[:, 6]) < 1e-5


@pytest.mark.parametrize("depth", DEPTHS.values(), ids=DEPTHS)
def test_a_run_is_within_a_thousandth_of_Radau(depth: float) -> None:
    commands = reference.RUNS["0.2 at 10 Hz"][:100]
    tight = reference.radau(commands, SAMPLE, reference.constants(depth))
    assert reference.nrmse(tight, run(declared(depth), commands, SAMPLE)[:, 2]) < 1e-3


@pytest.mark.parametrize("depth", DEPTHS.values(), ids=DEPTHS)
@pytest.mark.parametrize("name", reference.RUNS)
def test_acceleration_of_the_thesis_runs_is_within_a_thousandth(name: str, depth: float) -> None:
    commands = reference.RUNS[name]
    solution = reference.fine_steps(commands, SAMPLE, reference.constants(depth))
    result = run(declared(depth), commands, SAMPLE)
    assert reference.nrmse(solution[:, 6], result[:, 2]) < 1e-3
    assert reference.peak_error(solution[:, 6], result[:, 2]) < 5e-3
    for ours, theirs in ((0, 0), (1, 1), (3, 2), (4, 3), (6, 4)):  # position, velocity, P_A, P_B, spool
        assert reference.nrmse(solution[:, theirs], result[:, ours]) < 1e-3


def test_an_end_stop_hit_at_full_speed_is_within_a_hundredth() -> None:
    commands = np.ones(600)
    solution = reference.fine_steps(commands, SAMPLE, reference.constants(), steps=400)
    result = run(load_table("bergamo"), commands, SAMPLE)
    assert reference.nrmse(solution[:, 6], result[:, 2]) < 1e-2
    assert reference.nrmse(solution[:, 0], result[:, 0]) < 1e-3


def test_an_end_stop_hit_at_full_speed_is_radau_to_a_hundredth() -> None:
    c, commands = reference.constants(), np.ones(400)
    states = reference.fine_steps(commands, SAMPLE, c, steps=400)
    hit = int(np.argmax(states[:, 0] > c.half_stroke))
    assert states[hit, 1] > 0.5  # m/s
    tight = reference.radau(commands[hit - 3 : hit + 12], SAMPLE, c, start=states[hit - 3, :6])
    assert reference.nrmse(tight, run(load_table("bergamo"), commands, SAMPLE)[hit - 3 : hit + 12, 2]) < 1e-2


def test_error_falls_with_the_tolerance() -> None:
    commands = np.repeat(reference.RUNS["u7: 0.8 at 5 Hz"][:600:10], 10)
    solution = reference.fine_steps(commands, SAMPLE, reference.constants())[::10, 6]
    table = load_table("bergamo")
    errors = [
        reference.nrmse(solution, run(table, commands[::10], 10 * SAMPLE, tolerance=t)[:, 2])
        for t in (1e-2, 1e-4, 1e-6)
    ]
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]


def test_order_of_the_steps_is_five() -> None:
    """Steps of equal length through one held command of a table whose friction and edges are smooth."""
    smooth = {
        "friction.transition_velocity": 0.1,
        "valve.laminar_pressure": 1e6,
        "valve.underlap": 0.5,
        "valve.hysteresis": 0.0,
    }
    p = records(load_table("bergamo").with_values(smooth).vector())[0]

    def end(steps: int) -> float:
        y, work = initial_state(load_table("bergamo").vector()), workspace()
        h = 8e-3 / steps
        for _ in range(steps):
            table_rates(p, y, y, 0.0, DECLARED, work[0])
            assert spool_path(p, y, 0.3, h, work[PATH]) == h
            dormand_prince(p, y, work, h, 0.0, DECLARED)
            y[:DECLARED] = work[STAGE, :DECLARED]
        return y[VELOCITY]

    exact = end(512)
    errors = [abs(end(steps) - exact) for steps in (16, 32, 64)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(5.0, abs=0.6)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(5.0, abs=0.6)


@pytest.mark.parametrize("gap", [2e-4, 2e-3])
def test_backlash_between_rod_and_table_is_radau_to_a_hundredth(gap: float) -> None:
    table = load_table("bergamo").with_values({"effects.coupling_backlash.gap": gap})
    effect = table.effects["coupling_backlash"]
    backlash = (gap, effect.stiffness, effect.rod_mass, effect.damping)
    sample = 5e-3
    commands = reference.sine(0.3, 8.0, 0.24)[::5]
    tight = reference.radau_with_backlash(commands, sample, reference.constants(), backlash)
    assert reference.nrmse(tight, run(table, commands, sample)[:, 2]) < 1e-2


def test_the_smaller_the_backlash_the_nearer_the_declared_table() -> None:
    commands = reference.sine(0.3, 4.0, 0.3)
    rigid = run(load_table("bergamo"), commands, SAMPLE)[:, 2]

    def distance(gap: float) -> float:
        table = load_table("bergamo").with_values({"effects.coupling_backlash.gap": gap})
        return reference.nrmse(rigid, run(table, commands, SAMPLE)[:, 2])

    apart = [distance(gap) for gap in (1e-4, 1e-5, 2e-6, 5e-7)]
    assert apart == sorted(apart, reverse=True)
    assert apart[0] > 0.1
    assert apart[-1] < 2e-3


def test_a_lost_run_ends_at_once_and_says_nothing_finite() -> None:
    table = load_table("bergamo").with_values({"effects.payload_error.mass": -660.0})  # a negative mass runs away
    result = run(table, np.full(2000, 0.5), SAMPLE)
    assert not np.isfinite(result[-1, 2]) or abs(result[-1, 0]) > 0.1
