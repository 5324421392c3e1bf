"""The plant against the same model written a second time (test/reference_model.py) and integrated by scipy's Radau."""

from __future__ import annotations

import numpy as np
import pytest
import reference_model as reference

from shake_ros.core.plant.simulation import run
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


def test_error_falls_with_the_tolerance() -> None:
    commands = reference.RUNS["u7: 0.8 at 5 Hz"][:500]
    solution = reference.fine_steps(commands, SAMPLE, reference.constants())[:, 6]
    table = load_table("bergamo")
    errors = [reference.nrmse(solution, run(table, commands, SAMPLE, tolerance=t)[:, 2]) for t in (1e-3, 1e-5, 1e-7)]
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]


def test_a_lost_run_ends_at_once_and_says_nothing_finite() -> None:
    table = load_table("bergamo").with_values({"effects.payload_error.mass": -660.0})  # a negative mass runs away
    result = run(table, np.full(2000, 0.5), SAMPLE)
    assert not np.isfinite(result[-1, 2]) or abs(result[-1, 0]) > 0.1
