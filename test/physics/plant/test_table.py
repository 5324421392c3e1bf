"""The table as a node drives it: physics at rest, at the end stops, oil and momentum, determinism, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

from benchmarks.plant import reference_model as reference
from shake_ros.physics.plant.simulation import initial_state, run, run_batch
from shake_ros.physics.plant.table import Table
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table

SAMPLE = 0.001
BERGAMO = load_table("bergamo")


def test_table_at_rest_stays_and_its_pressures_settle_where_the_edges_feed_the_leakage() -> None:
    result = run(BERGAMO, np.zeros(3000), SAMPLE)
    assert np.max(np.abs(result[:, 0])) < 1e-9
    c = reference.constants()

    def surplus(p: float) -> float:
        fed = c.flow * c.underlap * (math.sqrt(c.supply - p) - math.sqrt(p - c.tank))
        return fed - c.external * p

    pressure = brentq(surplus, c.tank + 1e5, c.supply - 1e5)
    assert result[-1, 3] == pytest.approx(pressure, rel=2e-4)
    assert result[-1, 4] == pytest.approx(pressure, rel=2e-4)


def test_mass_times_acceleration_is_pressure_force_less_friction() -> None:
    result = run(BERGAMO, reference.sine(0.3, 2.0, 1.0), SAMPLE)
    v, a, load = result[:, 1], result[:, 2], result[:, 3] - result[:, 4]
    c = reference.constants()
    friction = (c.coulomb + c.rise * np.exp(-c.decay * np.abs(v))) * np.tanh(v / c.sharp) + c.viscous * v
    np.testing.assert_allclose(c.mass * a, c.area * load - friction, atol=1e-6 * c.mass)


def test_oil_that_enters_a_chamber_moves_the_piston_or_is_compressed() -> None:
    fine = 1e-4
    result = run(BERGAMO, np.repeat(reference.sine(0.5, 3.0, 0.5), 10), fine)
    c = reference.constants()
    x, v, p_a, p_b, spool = (result[:, i] for i in (0, 1, 3, 4, 6))
    sroot = lambda d: np.sign(d) * np.sqrt(np.abs(d))  # noqa: E731
    opened = lambda s: np.clip(s + c.underlap, 0.0, 1.0)  # noqa: E731
    into_a = c.flow * (opened(spool) * sroot(c.supply - p_a) - opened(-spool) * sroot(p_a - c.tank))
    leaked = c.external * p_a + c.internal * (p_a - p_b)
    squeezed = (c.half_volume + c.area * x) / c.modulus * np.gradient(p_a, fine)
    balance = cumulative_trapezoid(into_a - leaked - c.area * v - squeezed, dx=fine)
    moved = cumulative_trapezoid(np.abs(into_a), dx=fine)[-1]
    assert np.max(np.abs(balance)) < 1e-3 * moved


def test_end_stop_holds_the_table_at_full_speed_both_ways() -> None:
    for sign in (1.0, -1.0):
        result = run(BERGAMO, np.full(1500, sign), SAMPLE)
        assert np.max(np.abs(result[:, 1])) > 0.5  # m/s: it did arrive fast
        assert np.max(np.abs(result[:, 0])) < 0.130 + 0.003
        assert np.all(np.isfinite(result))
        assert abs(result[-1, 1]) < 1e-3


def test_table_driven_sample_by_sample_is_the_run() -> None:
    commands = 0.1 + reference.sine(0.4, 3.0, 0.4)
    dead_time = {"effects.command_delay.delay": 0.0037}
    for changes in (
        {},
        {"effects.supply_droop.resistance": 1e9, "effects.accelerometer_lag.time_constant": 0.003},
        dead_time,
        dead_time | {"effects.valve_null_shift.offset": 0.03, "effects.spool_hysteresis.width": 0.01},
        {"effects.command_delay.delay": 0.003, "effects.slow_valve.slowdown": 0.5},
    ):
        parameters = BERGAMO.with_values(changes)
        table, result = Table(parameters, SAMPLE), run(parameters, commands, SAMPLE)
        state = table.initial_state()
        for k, u in enumerate(commands):
            m = table.measure(state, k)
            assert m.truth_position == pytest.approx(result[k, 0], rel=1e-12, abs=1e-15)
            assert m.truth_velocity == pytest.approx(result[k, 1], rel=1e-12, abs=1e-15)
            state = table.advance(state, float(u))


def test_truth_acceleration_is_the_accelerometer_of_an_ideal_sensor() -> None:
    table, commands = Table(BERGAMO, SAMPLE), reference.sine(0.4, 3.0, 0.2)
    result, state = run(BERGAMO, commands, SAMPLE), table.initial_state()
    for k, u in enumerate(commands):
        assert table.measure(state, k).truth_acceleration == pytest.approx(result[k, 2], rel=1e-9, abs=1e-9)
        state = table.advance(state, float(u))


def test_advance_leaves_the_state_it_was_given_alone() -> None:
    table = Table(BERGAMO, SAMPLE)
    state = table.initial_state()
    before = state.copy()
    table.advance(state, 0.5)
    np.testing.assert_array_equal(state, before)


def test_two_runs_are_equal_to_the_bit_and_a_batch_is_its_runs() -> None:
    commands = reference.sine(0.7, 2.0, 0.5)
    sets = [BERGAMO, BERGAMO.with_values({"body.specimen_mass": 400.0, "effects.soft_zone.depth": 0.5})]
    first = [run(p, commands, SAMPLE) for p in sets]
    second = [run(p, commands, SAMPLE) for p in sets]
    np.testing.assert_array_equal(first, second)
    vectors = np.array([p.vector() for p in sets])
    starts = np.array([initial_state(v) for v in vectors])
    batch = run_batch(vectors, starts, commands, SAMPLE, columns=(0, 2))
    alone = np.array(first)[:, :, [0, 2]]
    np.testing.assert_array_equal(batch[0], alone[0])
    assert np.max(np.abs(batch[1] - alone[1]) / np.std(alone[1], axis=0)) < 1e-3  # it takes the steps of the first


def test_inputs_of_a_run_are_left_alone() -> None:
    commands, forces = reference.sine(0.7, 2.0, 0.1), np.full(100, 50.0)
    state = initial_state(BERGAMO.vector())
    copies = commands.copy(), forces.copy(), state.copy()
    run(BERGAMO, commands, SAMPLE, forces=forces, state=state)
    for given, copy in zip((commands, forces, state), copies, strict=True):
        np.testing.assert_array_equal(given, copy)


def test_an_external_force_pushes_along_its_sign() -> None:
    ahead = run(BERGAMO, np.zeros(50), SAMPLE, forces=np.full(50, 2000.0))
    assert ahead[10, 0] > 0.0
    np.testing.assert_allclose(ahead[:, 0], -run(BERGAMO, np.zeros(50), SAMPLE, forces=np.full(50, -2000.0))[:, 0])


def test_the_declared_table_is_the_same_mirrored() -> None:
    commands = reference.sine(0.4, 3.0, 0.5)
    ahead, back = run(BERGAMO, commands, SAMPLE), run(BERGAMO, -commands, SAMPLE)
    np.testing.assert_allclose(ahead[:, :3], -back[:, :3], atol=1e-9)
    np.testing.assert_allclose(ahead[:, 3], back[:, 4], rtol=1e-9)


def test_commands_recorded_in_a_closed_loop_with_a_dead_time_give_the_same_motion_again() -> None:
    parameters = BERGAMO.with_values({"effects.command_delay.delay": 0.0053})
    table = Table(parameters, SAMPLE)
    state, motion, commands = table.initial_state(), [], []
    for k in range(300):
        position = table.measure(state, k).truth_position
        motion.append(position)
        commands.append(8.0 * (0.02 - position))  # a step of the reference: the first command is far from null
        state = table.advance(state, commands[-1])
    assert commands[0] == pytest.approx(0.16)
    again = run(parameters, np.array(commands), SAMPLE)
    np.testing.assert_allclose(again[:, 0], motion, rtol=1e-9, atol=1e-15)


def test_a_command_that_stands_before_the_first_one_acts_for_the_dead_time() -> None:
    whole = np.concatenate([np.full(20, 0.3), np.full(40, -0.2)])
    late = BERGAMO.with_values({"effects.command_delay.delay": 0.005})
    state = initial_state(late.vector())
    begun = run(late, whole[20:], SAMPLE, state=state, command_before=0.3)
    expected = run(BERGAMO, whole[15:55], SAMPLE, state=state)
    np.testing.assert_allclose(begun, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_command_or_force_that_is_not_finite_is_refused(bad: float) -> None:
    table = Table(BERGAMO, SAMPLE)
    with pytest.raises(ShakeError, match="not finite"):
        table.advance(table.initial_state(), bad)
    with pytest.raises(ShakeError, match="not finite"):
        table.advance(table.initial_state(), 0.0, bad)
    commands = np.zeros(10)
    commands[3] = bad
    with pytest.raises(ShakeError, match="valve command: sample 3"):
        run(BERGAMO, commands, SAMPLE)


def test_series_of_another_length_are_refused() -> None:
    with pytest.raises(ShakeError, match="force"):
        run(BERGAMO, np.zeros(10), SAMPLE, forces=np.zeros(9))
    with pytest.raises(ShakeError, match="position"):
        run(BERGAMO, np.zeros(10), SAMPLE, position=np.zeros(11))


@pytest.mark.parametrize("sample_time", [0.0, -0.001, math.nan, 1.0])
def test_a_senseless_sample_time_is_refused(sample_time: float) -> None:
    with pytest.raises(ShakeError, match="sample_time"):
        Table(BERGAMO, sample_time)


def test_a_measured_position_sets_the_place_of_every_sample() -> None:
    track = 0.05 + 0.001 * np.arange(100) / 100.0
    result = run(BERGAMO, np.zeros(100), SAMPLE, position=track)
    np.testing.assert_array_equal(result[:, 0], track)


def test_a_slow_transducer_is_followed_to_where_the_table_is_not_to_where_it_was() -> None:
    slow = BERGAMO.with_values({"effects.position_sensor_lag.time_constant": 0.09})
    sine = 0.3 * np.sin(2.0 * np.pi * 1.5 * np.arange(2000) * SAMPLE)
    free = run(slow, sine, SAMPLE)
    away = free[:, 1] * 0.09  # from what it shows to where it is
    assert np.max(np.abs(away)) > 0.01
    np.testing.assert_allclose(run(slow, sine, SAMPLE, position=free[:, 0])[:, 1:5], free[:, 1:5], rtol=1e-3, atol=1e-3)
    was = run(slow, sine, SAMPLE, position=free[:, 0] - away)  # of a transducer that is followed as if it were exact
    assert np.max(np.abs(was[:, 2] - free[:, 2])) > 0.02 * np.max(np.abs(free[:, 2]))
