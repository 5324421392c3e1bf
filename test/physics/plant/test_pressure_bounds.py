"""Pressures of violent runs stay between the cavitation limit and what supply and inertia can make, or it is said."""

from __future__ import annotations

import math

import numpy as np
import pytest
from watched_pressures import findings_of_run

from shake_ros.physics.bulk_modulus import BULK_MODULI
from shake_ros.physics.plant.cylinder import LOOSE, PressureWatch, highest_pressure, smallest_volumes
from shake_ros.physics.plant.simulation import run
from shake_ros.physics.plant.states import POSITION, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.physics.plant.table import Table
from shake_ros.settings import load_table, load_variant

SAMPLE = 1e-3
DECLARED = load_table("bergamo")
CAVITATING = load_table("bergamo_cavitation")
STIFFENING = load_variant("bulk_modulus", "lee", BULK_MODULI)[1]


def violent() -> dict[str, tuple[dict[str, float], np.ndarray]]:
    """Changes of the table and commands of 1.2 s that throw it about."""
    t = SAMPLE * np.arange(1200)
    draw = np.random.default_rng(11)
    thrown = np.where(np.sin(2.0 * np.pi * 9.0 * t) > 0.0, 1.0, -1.0)
    shut = np.where(t < 0.15, 1.0, 0.0)
    return {
        "full speed, then shut": ({}, shut),
        "full speed of a heavy specimen, then shut": ({"body.specimen_mass": 3000.0}, shut),
        "from end to end": ({}, np.where(t < 0.6, 1.0, -1.0)),
        "heavy, from end to end": ({"body.specimen_mass": 3000.0}, np.where(t < 0.6, 1.0, -1.0)),
        "thrown at 9 Hz": ({}, thrown),
        "thrown at 9 Hz, overlapped": ({"valve.underlap": -0.01}, thrown),
        "at random": ({"body.specimen_mass": 1500.0}, np.repeat(draw.uniform(-1.0, 1.0, 60), 20)),
    }


@pytest.mark.parametrize("name", violent())
def test_with_cavitation_every_pressure_stays_within_the_bounds(name: str) -> None:
    changes, commands = violent()[name]
    table = CAVITATING.with_values(changes)
    result = run(table, commands, SAMPLE)
    assert np.all(np.isfinite(result))
    assert result[:, 3:5].min() >= table.cavitation.pressure
    assert table.cavitation.pressure < table.supply.tank_pressure
    bound = highest_pressure(table, np.max(np.abs(result[:, 1])), np.max(np.abs(result[:, 0])))
    assert result[:, 3:5].max() <= bound
    assert findings_of_run(table, result, SAMPLE) == ()


def test_a_table_that_is_shut_in_full_motion_reaches_more_than_half_of_the_upper_bound() -> None:
    values = {"body.specimen_mass": 3000.0, "valve.underlap": -0.02, "friction.coulomb_level": 0.0}
    table = DECLARED.with_values(values)
    result = run(table, np.where(np.arange(400) < 150, 0.6, 0.0), SAMPLE)
    speed, reach = abs(result[150, 1]), np.max(np.abs(result[:, 0]))
    bound = highest_pressure(table, speed, reach)
    assert 0.5 * bound < result[:, 3:5].max() <= bound


def test_the_surge_is_the_kinetic_energy_in_the_oil_spring() -> None:
    speed, volume = 0.4, smallest_volumes(DECLARED, 0.05).a
    surge = highest_pressure(DECLARED, speed, 0.05) - DECLARED.supply.supply_pressure
    in_oil = 0.5 * volume / DECLARED.bulk_modulus.modulus * surge**2
    assert in_oil == pytest.approx(0.5 * DECLARED.moved_mass * speed**2)
    assert volume == pytest.approx(1.2293e-4 - 9.4562e-4 * 0.05)
    pushed = highest_pressure(DECLARED, speed, 0.05, force=-945.62)
    assert pushed - highest_pressure(DECLARED, speed, 0.05) == pytest.approx(1e6)


def test_the_declared_table_says_where_its_oil_bears_tension() -> None:
    table = DECLARED.with_values({"body.specimen_mass": 3000.0})
    result = run(table, violent()["full speed, then shut"][1], SAMPLE)
    below = int(np.sum(result[:, 3] < 0.0)), int(np.sum(result[:, 4] < 0.0))
    assert max(below) > 3
    found = findings_of_run(table, result, SAMPLE)
    assert len(found) == sum(count > 0 for count in below)
    worst = "pressure_a" if below[0] > 0 else "pressure_b"
    assert found[0] == f"{worst} below absolute zero for {max(below[0] or below[1], 1)} ms: the table has no cavitation"


def test_ordinary_motion_has_nothing_to_say() -> None:
    commands = 0.7 * np.sin(2.0 * np.pi * 2.0 * SAMPLE * np.arange(1000))
    assert findings_of_run(DECLARED, run(DECLARED, commands, SAMPLE), SAMPLE) == ()


def test_a_pressure_beyond_what_inertia_can_make_is_named_with_both_numbers() -> None:
    watch = PressureWatch(DECLARED, SAMPLE)
    watch.observe(0.0, 0.1, 5e7, 1e7)
    (found,) = watch.findings()
    surge = 0.1 * math.sqrt(1.16e9 * 650.0 / 1.2293e-4)
    assert "5e+07 Pa" in found
    assert f"{206e5 + surge:.4g} Pa" in found


def test_where_a_void_has_opened_the_watch_is_given_the_pressures_that_act() -> None:
    table = CAVITATING.with_values({"body.specimen_mass": 3000.0})
    simulation, watch = Table(table, SAMPLE), PressureWatch(table, SAMPLE)
    state, lowest = simulation.initial_state(), np.inf
    for k in range(300):
        state = simulation.advance(state, 1.0 if k < 150 else 0.0)
        lowest = min(lowest, *state[PRESSURE_A : PRESSURE_B + 1])
        acting = simulation.pressures(state)
        assert min(acting) >= table.cavitation.pressure
        watch.observe(state[POSITION], state[VELOCITY], *acting)
    assert lowest < table.cavitation.pressure  # what the liquid would have to bear
    assert watch.findings() == ()


@pytest.mark.parametrize("name", LOOSE)
def test_no_upper_bound_is_claimed_where_it_does_not_hold(name: str) -> None:
    if name == "bulk_modulus.kind":
        table = DECLARED.with_sections(bulk_modulus=STIFFENING)
    else:
        table = DECLARED.with_values({name: 1e-6 if name.endswith(("compliance", "gap")) else 1})
    watch = PressureWatch(table, SAMPLE)
    watch.observe(0.0, 0.1, 5e7, 1e7)
    assert watch.findings() == ()


def test_the_variant_is_the_declared_table_but_for_cavitation() -> None:
    assert CAVITATING.with_sections(cavitation=DECLARED.cavitation) == DECLARED
