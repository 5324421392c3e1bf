"""Every effect: absent at its neutral value, present and finite elsewhere, its parameters checked."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.plant import reference_model as reference
from shake_ros.physics.effects import EFFECTS, PLACES
from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.right_hand_side import active_states, right_hand_side
from shake_ros.physics.plant.simulation import initial_state, run
from shake_ros.physics.plant.states import BASE, BASE_RATE, POSITION, PRESSURE_A, STATES, VELOCITY
from shake_ros.settings import load_table

SAMPLE = 0.001
BERGAMO = load_table("bergamo")
COMMANDS = reference.sine(0.3, 4.0, 0.6)
SHORT = COMMANDS[:250]

STRENGTHS = {  # a strength at which the effect shows in a run of 0.6 s
    "spool_deadband": 0.03,
    "spool_hysteresis": 0.03,
    "asymmetric_flow_gain": 0.2,
    "valve_null_shift": 0.02,
    "slow_valve": 0.7,
    "turbulent_leakage": 1e-9,
    "supply_droop": 1e10,
    "tank_back_pressure": 1e6,
    "pressure_dependent_bulk_modulus": 10.0,
    "entrained_air": 0.03,
    "soft_zone": 0.7,
    "dead_volume": 5e-5,
    "oil_warming": 20.0,
    "friction_asymmetry": 0.5,
    "position_dependent_friction": 6000.0,
    "presliding_friction": 1e-3,
    "film_friction": 0.6,
    "quadratic_drag": 5000.0,
    "constant_force": 500.0,
    "stiffness_to_ground": 5e4,
    "specimen_resonance": 150.0,
    "coupling_backlash": 1e-3,
    "base_flexibility": 1e-7,
    "payload_error": 150.0,
    "accelerometer_scale": 0.1,
    "accelerometer_bias": 0.3,
    "accelerometer_lag": 0.01,
    "position_sensor_lag": 0.01,
    "command_delay": 0.0043,
}
FULL = [name for name, effect in EFFECTS.items() if "full" in effect.models and name != "unlisted"]  # test_unlisted.py
CONTINUOUS = [  # effects whose influence vanishes with their strength (pre-sliding sticks at rest, (6.10) creeps)
    name for name in FULL if name != "presliding_friction"
]


def strength(effect: str) -> str:
    """Dotted name of the effect's strength, its first field."""
    return f"effects.{effect}.{dataclasses.fields(EFFECTS[effect])[0].name}"


def others(effect: str) -> dict[str, float]:
    """The effect's further parameters away from their defaults; a second strength keeps its neutral zero."""
    return {
        f"effects.{effect}.{f.name}": min(max(1.3 * f.default, f.metadata["low"]), f.metadata["high"])
        for f in dataclasses.fields(EFFECTS[effect])[1:]
    }


def test_every_effect_of_the_full_model_has_a_trial_here() -> None:
    assert sorted(STRENGTHS) == sorted(FULL)


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_states_place_dependence_and_a_neutral_default(effect: str) -> None:
    cls = EFFECTS[effect]
    assert cls.place in PLACES
    assert isinstance(cls.depends_on, tuple)
    assert cls.__doc__
    assert dataclasses.fields(cls)[0].default == 0.0
    neutral = cls()
    assert all(np.isfinite(getattr(neutral, f.name)) for f in dataclasses.fields(cls))


@pytest.fixture(scope="module")
def declared() -> np.ndarray:
    return run(BERGAMO, COMMANDS, SAMPLE)


@pytest.mark.parametrize("effect", FULL)
def test_at_its_neutral_value_the_declared_model_remains(effect: str, declared: np.ndarray) -> None:
    table = BERGAMO.with_values({**others(effect), strength(effect): 0.0})
    np.testing.assert_allclose(run(table, COMMANDS, SAMPLE), declared, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("effect", FULL)
def test_elsewhere_it_shows_and_stays_finite(effect: str, declared: np.ndarray) -> None:
    result = run(BERGAMO.with_values({strength(effect): STRENGTHS[effect]}), COMMANDS, SAMPLE)
    assert np.all(np.isfinite(result))
    assert np.max(np.abs(result[:, 0])) < 0.14
    channel = 0 if effect == "position_sensor_lag" else 2
    assert reference.nrmse(declared[:, channel], result[:, channel]) > 0.005


@pytest.mark.parametrize("effect", CONTINUOUS)
def test_a_millionth_of_it_is_hardly_there(effect: str, declared: np.ndarray) -> None:
    result = run(BERGAMO.with_values({strength(effect): 1e-6 * STRENGTHS[effect]}), COMMANDS, SAMPLE)
    assert reference.nrmse(declared[:, 2], result[:, 2]) < 2e-3
    assert reference.nrmse(declared[:, 0], result[:, 0]) < 2e-3


@pytest.mark.parametrize("effect", FULL)
def test_it_runs_together_with_every_other(effect: str) -> None:
    rest = {strength(name): 0.3 * value for name, value in STRENGTHS.items() if name != effect}
    without = run(BERGAMO.with_values(rest), SHORT, SAMPLE)
    both = run(BERGAMO.with_values({**rest, strength(effect): STRENGTHS[effect]}), SHORT, SAMPLE)
    assert np.all(np.isfinite(both))
    assert not np.array_equal(without, both)


def test_a_delay_by_a_part_of_a_sample_shifts_the_command_by_it() -> None:
    delayed = run(BERGAMO.with_values({"effects.command_delay.delay": 0.0025}), COMMANDS, SAMPLE)
    late = np.concatenate([np.zeros(5), np.repeat(COMMANDS, 2)])[: 2 * len(COMMANDS)]  # at half the sample time
    shifted = run(BERGAMO, late, 0.5 * SAMPLE)[::2]
    assert reference.nrmse(shifted[:, 2], delayed[:, 2]) < 1e-3


def test_scale_and_bias_of_the_accelerometer_are_exact(declared: np.ndarray) -> None:
    table = BERGAMO.with_values({"effects.accelerometer_scale.error": 0.1, "effects.accelerometer_bias.bias": -0.2})
    np.testing.assert_allclose(run(table, COMMANDS, SAMPLE)[:, 2], 1.1 * declared[:, 2] - 0.2, rtol=1e-12, atol=1e-12)


def test_a_payload_error_is_a_heavier_specimen() -> None:
    heavier = run(BERGAMO.with_values({"body.specimen_mass": 350.0}), COMMANDS, SAMPLE)
    wrong = run(BERGAMO.with_values({"effects.payload_error.mass": 150.0}), COMMANDS, SAMPLE)
    np.testing.assert_allclose(wrong, heavier, rtol=1e-12, atol=1e-12)


def test_a_null_shift_is_a_constant_command() -> None:
    shifted = run(BERGAMO.with_values({"effects.valve_null_shift.offset": 0.02}), COMMANDS, SAMPLE)
    np.testing.assert_allclose(shifted, run(BERGAMO, COMMANDS + 0.02, SAMPLE), rtol=1e-12, atol=1e-12)


def test_supply_pressure_droops_by_resistance_times_flow() -> None:
    table = BERGAMO.with_values({"effects.supply_droop.resistance": 5e9})
    result = run(table, np.full(200, 0.5), SAMPLE)
    v, p_s = result[-1, 1], result[-1, 5]
    flow = BERGAMO.body.piston_area * v  # steady: what moves the piston comes from the supply, and a little underlap
    assert BERGAMO.supply.supply_pressure - p_s == pytest.approx(5e9 * flow, rel=0.05)


def test_a_stiff_specimen_moves_with_the_table(declared: np.ndarray) -> None:
    stiff = {"effects.specimen_resonance.frequency": 200.0, "effects.specimen_resonance.damping": 0.7}
    result = run(BERGAMO.with_values({strength("specimen_resonance"): 200.0, **stiff}), COMMANDS, SAMPLE)
    assert reference.nrmse(declared[:, 1], result[:, 1]) < 0.01


def test_presliding_friction_springs_before_it_slides() -> None:
    table = BERGAMO.with_values({"effects.presliding_friction.distance": 1e-4})
    push = np.full(400, 100.0)  # below the break-away force of 240 N
    held = run(table, np.zeros(400), SAMPLE, forces=push)[:, 0]
    assert 0.0 < held[-1] < 1e-4
    released = run(table, np.zeros(800), SAMPLE, forces=np.concatenate([push, np.zeros(400)]))[:, 0]
    assert released[-1] < held[-1]


@pytest.mark.parametrize(
    ("values", "constants", "offset"),
    [
        ({"dead_volume.volume": 5e-5}, dict.fromkeys(("half_volume", "half_volume_b"), 1.7293e-4), 0.0),  # (3.24)
        ({"tank_back_pressure.pressure": 1e6}, {"tank": 1e6}, 0.0),
        ({"slow_valve.slowdown": 0.7}, {"omega": 0.3 * 1600.0}, 0.0),
        ({"valve_null_shift.offset": 0.02}, {}, 0.02),
        ({"spool_hysteresis.width": 0.02}, {"friction": 0.021}, 0.0),
        ({"payload_error.mass": 150.0}, {"mass": 800.0}, 0.0),
    ],
    ids=lambda value: next(iter(value), "").partition(".")[0] if isinstance(value, dict) else "",
)
def test_an_effect_that_is_another_number_gives_the_solution_for_that_number(
    values: dict[str, float], constants: dict[str, float], offset: float
) -> None:
    """Against the second writing of the equations in small steps."""
    changes = dict(constants)
    if "tank" in changes:
        changes["tank"] += reference.constants().tank
    table = BERGAMO.with_values({f"effects.{name}": value for name, value in values.items()})
    solution = reference.fine_steps(COMMANDS + offset, SAMPLE, reference.constants(**changes))
    result = run(table, COMMANDS, SAMPLE)
    if "tank" in changes:  # the solution starts half-way between other pressures
        solution, result = solution[200:], result[200:]
    assert reference.nrmse(solution[:, 6], result[:, 2]) < 5e-3
    assert reference.nrmse(solution[:, 1], result[:, 1]) < 2e-3


def test_table_and_base_together_are_moved_by_the_ground_alone() -> None:
    """Momentum: what the cylinder does to the table it does to the base; only springs and dampers to ground remain."""
    k, compliance, frequency, ratio = 3e5, 1e-7, 12.0, 0.05
    values = {
        "effects.stiffness_to_ground.stiffness": k,
        "effects.base_flexibility.compliance": compliance,
        "effects.base_flexibility.frequency": frequency,
        "effects.base_flexibility.damping": ratio,
    }
    table = BERGAMO.with_values(values)
    y, rates = initial_state(table.vector()), np.zeros(STATES)
    y[POSITION], y[VELOCITY], y[BASE], y[BASE_RATE], y[PRESSURE_A] = 0.02, -0.1, 7e-4, 0.03, 1.3e7
    p = records(table.vector())[0]
    acceleration = right_hand_side(p, y, y, 0.0, 0.0, active_states(p), rates)
    stiffness, omega = 1.0 / compliance, 2.0 * np.pi * frequency
    mass = stiffness / omega**2
    damper = 2.0 * ratio * np.sqrt(stiffness * mass)
    of_ground = -k * (0.02 + 7e-4) - stiffness * 7e-4 - damper * 0.03
    assert table.moved_mass * acceleration + mass * rates[BASE_RATE] == pytest.approx(of_ground, rel=1e-9)
    assert rates[VELOCITY] + rates[BASE_RATE] == pytest.approx(acceleration, rel=1e-12)


@pytest.mark.parametrize("speed", [2e-4, 0.3])  # within the passage through rest and far beyond it
def test_friction_asymmetry_is_that_of_the_direction_whatever_the_speed(speed: float) -> None:
    """Without a viscous part the friction of both directions is as (1 + a) to (1 - a)."""

    def friction(velocity: float, **effects: float) -> float:
        values = {f"effects.{name.replace('__', '.')}": value for name, value in effects.items()}
        table = BERGAMO.with_values({"friction.viscous": 0.0, **values})
        p, accelerations = records(table.vector())[0], []
        for v in (velocity, 0.0):
            y, rates = initial_state(table.vector()), np.zeros(STATES)
            y[VELOCITY] = v
            accelerations.append(right_hand_side(p, y, y, 0.0, 0.0, active_states(p), rates))
        return table.moved_mass * (accelerations[1] - accelerations[0])

    plain = friction(speed)
    assert plain > 0.0
    assert friction(-speed) == pytest.approx(-plain)
    assert friction(speed, friction_asymmetry__asymmetry=0.4) == pytest.approx(1.4 * plain)
    assert friction(-speed, friction_asymmetry__asymmetry=0.4) == pytest.approx(-0.6 * plain)
