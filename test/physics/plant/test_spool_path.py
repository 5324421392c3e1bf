"""The spool over a step: closed form, stroke and speed limit against very small steps, and the damping of any valve."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from shake_ros.physics.plant.dormand_prince import END, END_RATE, LENGTH, NODES, spool_path
from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.simulation import initial_state, run
from shake_ros.physics.plant.states import SPOOL, SPOOL_RATE
from shake_ros.physics.valve.simplified import motion_weights
from shake_ros.settings import load_table

BERGAMO = load_table("bergamo")
OMEGA, DAMPING = 1600.0, 0.736


def small_steps(commands, sample_time, limit, steps=2000, friction=0.0):
    """Spool at the samples: explicit Euler of (3.19)–(3.22) in very small steps, dry friction taken off the speed."""
    x, v, out, h = 0.0, 0.0, [], sample_time / steps
    for u in commands:
        out.append(x)
        for _ in range(steps):
            a = OMEGA * (OMEGA * (u - x) - 2.0 * DAMPING * v)
            x += h * v
            v = min(max(v + h * a, -limit), limit)
            v = float(np.sign(v)) * max(abs(v) - h * OMEGA**2 * friction, 0.0)
            if abs(x) > 1.0:
                x, v = float(np.sign(x)), 0.0
    return np.array(out)


@pytest.mark.parametrize("damping", [0.05, 0.736, 0.9999999, 1.0, 1.0000001, 4.0])
@pytest.mark.parametrize("time", [1e-9, 1e-4, 1e-3, 0.1])
def test_weights_are_the_matrix_exponential_at_any_damping(damping, time):
    a, b, c = motion_weights(OMEGA, damping, time)
    exact = expm(time * np.array([[0.0, 1.0], [-(OMEGA**2), -2.0 * damping * OMEGA]]))
    np.testing.assert_allclose([a, b, c], [exact[0, 0], exact[0, 1], exact[1, 1]], rtol=1e-6, atol=1e-12)
    assert -(OMEGA**2) * b == pytest.approx(exact[1, 0], rel=1e-6, abs=1e-9)


def test_a_step_ends_where_the_spool_reaches_the_end_of_its_stroke():
    vector = BERGAMO.with_values({"valve.hysteresis": 0.0}).vector()
    p, path, y = records(vector)[0], np.zeros(LENGTH), initial_state(vector)
    y[SPOOL], y[SPOOL_RATE] = 0.9, 400.0
    length = spool_path(p, y, 0.95, 1e-3, path)
    assert 0.0 < length < 1e-3
    assert path[END] == pytest.approx(1.0, abs=1e-9)
    assert path[END_RATE] == 0.0
    assert np.all(np.abs(path[:END]) < 1.0)
    a, b, _ = motion_weights(OMEGA, DAMPING, length)
    assert 0.95 + a * (0.9 - 0.95) + b * 400.0 == pytest.approx(1.0, abs=1e-9)
    assert len(NODES) == END + 1


def test_a_spool_thrown_from_end_to_end_stops_there_and_comes_back_from_rest():
    table = BERGAMO.with_values({"valve.hysteresis": 0.0})
    commands = np.concatenate([np.ones(3), -np.ones(3), 0.97 * np.ones(4), np.zeros(3)])
    expected = small_steps(commands, 1e-3, table.valve.rate_limit)
    result = run(table, commands, 1e-3)[:, 6]
    assert np.max(np.abs(result)) <= 1.0
    np.testing.assert_allclose(result, expected, atol=2e-3)


@pytest.mark.parametrize("limit", [1e4, 90.0])
@pytest.mark.parametrize("friction", [0.001, 0.03])
def test_dry_friction_on_the_spool_is_that_of_very_small_steps(friction, limit):
    table = BERGAMO.with_values({"valve.hysteresis": friction, "valve.rate_limit": limit})
    commands = 0.1 * np.array([1.0, 1.2, 1.1, 0.9, 0.7, 0.7, -0.5, -0.9, -0.8, -0.82, -0.6, 0.0, 0.2, 0.0, 0.0, 0.0])
    expected = small_steps(commands, 1e-3, limit, friction=friction)
    result = run(table, commands, 1e-3)[:, 6]
    np.testing.assert_allclose(result, expected, atol=3e-4)
    assert (
        np.max(np.abs(run(BERGAMO.with_values({"valve.hysteresis": 0.0}), commands, 1e-3)[:, 6] - expected))
        > friction / 2
    )


def test_a_spool_at_rest_stays_where_dry_friction_holds_it():
    table = BERGAMO.with_values({"valve.hysteresis": 0.01})
    assert np.all(run(table, 0.0099 * np.ones(20), 1e-3)[:, 6] == 0.0)
    moved = run(table, 0.05 * np.ones(200), 1e-3)[-1, 6]
    assert 0.04 <= moved <= 0.06


@pytest.mark.parametrize("limit", [100.0, 400.0, 900.0])
def test_the_speed_limit_is_that_of_very_small_steps(limit):
    table = BERGAMO.with_values({"valve.hysteresis": 0.0, "valve.rate_limit": limit})
    commands = 0.6 * np.array([1.0, 1.0, -1.0, -1.0, 0.2, 0.2, 0.2, -0.5, 0.0, 0.0])
    expected = small_steps(commands, 2e-3, limit)
    np.testing.assert_allclose(run(table, commands, 2e-3)[:, 6], expected, atol=2e-3)


def test_a_limit_that_is_not_reached_changes_nothing_to_speak_of():
    commands = 0.05 * np.sin(np.arange(60))
    free = BERGAMO.with_values({"valve.hysteresis": 0.0})
    near = free.with_values({"valve.rate_limit": 60.0})
    np.testing.assert_allclose(run(near, commands, 1e-3)[:, 6], run(free, commands, 1e-3)[:, 6], atol=1e-4)
