"""Neighbours of a table: drawn as their covariance says, under the loads that are asked for; the oil column."""

from __future__ import annotations

import math

import numpy as np

from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.metrics import SETTLING, come_to_rest, ringing, settle_first, still_moving
from shake_ros.control.robust import (
    DAMPINGS,
    QUICK_DAMPING,
    QUICK_JERK,
    Load,
    RobustSettings,
    Search,
    Uncertainty,
    drawn,
    neighbours,
    oil_column,
    points,
    uncertainty_of,
)
from shake_ros.control.trials import trial
from shake_ros.physics.plant.linearisation import linearise, oil_column_frequency, operating_point
from shake_ros.settings import find, load_table, read_yaml

TABLE = load_table("bergamo")
CONTENT = read_yaml(find("robust_tuning", "default"))
SETTINGS = RobustSettings.from_mapping(CONTENT["numbers"], "default")
LOADS = [Load(**given) for given in CONTENT["loads"]]


def test_draws_have_the_spread_and_the_correlation_of_parameters_whose_units_differ_by_twenty_orders() -> None:
    names = ("bulk_modulus.modulus", "leakage.internal", "valve.flow_coefficient")
    spread = np.array([1e7, 1e-13, 1e-9])
    likeness = np.array([[1.0, 0.8, 0.0], [0.8, 1.0, -0.5], [0.0, -0.5, 1.0]])
    rng = np.random.default_rng(3)
    known = Uncertainty(names, likeness * spread * spread[:, None])
    rows = np.array([list(drawn(TABLE, known, rng).values()) for _ in range(4000)])
    np.testing.assert_allclose(np.std(rows, axis=0), spread, rtol=0.05)
    np.testing.assert_allclose(np.corrcoef(rows.T), likeness, atol=0.05)


def test_neighbours_carry_rigid_and_swaying_specimens_in_turn_and_the_supply_low_and_high() -> None:
    known = uncertainty_of(TABLE, SETTINGS)
    found = neighbours(TABLE, known, LOADS, SETTINGS)
    frequencies = [t.value("effects.specimen_resonance.frequency") for t in found]
    swaying = [f for t, f in zip(found, frequencies, strict=True) if t.value("effects.specimen_resonance.mass") > 0.0]
    assert len(found) == SETTINGS.tables and found[0] is TABLE
    assert {4.0, 6.0} <= set(swaying)
    assert {0.0, 150.0, 500.0} <= {t.value("body.specimen_mass") for t in found[1:]}
    supplies = {round(t.supply.supply_pressure / TABLE.supply.supply_pressure, 6) for t in found[1:]}
    assert supplies == {0.9, 1.1}


def test_oil_column_that_leakage_damps_beyond_oscillation_has_the_frequency_of_its_spring() -> None:
    # the closed form of oil spring and mass, with the damping that a laminar leakage adds: C 2E/V_chamber / (2 ω)
    leaking = TABLE.with_values({"leakage.internal": 4e-11})
    frequency, damping = oil_column(linearise(leaking, points(leaking, SETTINGS)[0]))
    assert math.isclose(frequency, oil_column_frequency(TABLE), rel_tol=0.25)
    rate = 2.0 * TABLE.value("bulk_modulus.modulus") * 4e-11 / (0.5 * TABLE.body.cylinder_volume)
    assert damping > 0.9
    assert math.isclose(damping, rate / (2.0 * oil_column_frequency(TABLE)), rel_tol=0.3)


def test_limit_cycle_below_the_ringing_band_is_seen_at_the_rest_that_follows() -> None:
    t = np.arange(4000) * 1e-3
    wanted = come_to_rest(np.column_stack([0 * t, 0 * t, np.sin(12.0 * t)]), 1e-3)
    found = wanted.copy()
    found[:, 2] += 0.2 * np.sin(2.0 * np.pi * 8.0 * np.arange(len(wanted)) * 1e-3)
    run = ClosedLoop(1e-3, wanted, wanted, found, wanted[:, 0], wanted)
    assert ringing(run) < 0.02
    assert math.isclose(still_moving(run), 0.2 / math.sqrt(2.0) / np.sqrt(np.mean(wanted[:, 2] ** 2)), rel_tol=0.01)


def test_what_a_table_does_when_it_is_let_go_is_no_error_of_the_motion_that_follows() -> None:
    t = np.arange(4000) * 1e-3
    motion = np.column_stack([0.03 * np.sin(9.0 * t), 0.27 * np.cos(9.0 * t), -2.43 * np.sin(9.0 * t)])
    wanted = settle_first(come_to_rest(motion, 1e-3), 1e-3)
    found = wanted.copy()
    letting_go = slice(0, round(0.9 * SETTLING / 1e-3))
    found[letting_go, 2] += 4.0 * np.sin(2.0 * np.pi * 30.0 * np.arange(len(found))[letting_go] * 1e-3)
    command = np.full(len(found), 0.1)
    command[letting_go] = 1.0
    judged = trial(ClosedLoop(1e-3, wanted, wanted, found, command, wanted), 1.0, 0.3)
    assert judged.errors.tolist() == [0.0, 0.0, 0.0]
    assert judged.ringing == judged.still == judged.at_limit == 0.0


def test_calm_design_holds_in_slow_motion_where_the_fastest_undamped_one_does_not() -> None:
    # little leakage, and friction that falls with speed: 15 % of damping at 0.1 m/s, 3 % at 0.02 m/s
    weak = {"leakage.internal": 6e-13, "leakage.external": 1e-13, "bulk_modulus.modulus": 9e8}
    falling = {"friction.coulomb_level": 250.0, "friction.stribeck_rise": 300.0, "friction.stribeck_decay": 25.0}
    table = TABLE.with_values(weak | falling)
    moving, slow = (linearise(table, operating_point(table, 0.0, speed)) for speed in (0.1, 0.02))
    assert oil_column(slow)[1] < 0.3 * oil_column(moving)[1]
    search = Search([table], SETTINGS)
    fastest, (calm, quick) = search.best([0.0]), search.calm(DAMPINGS)
    assert fastest
    assert max(search.worst(fastest, search.cases)) <= SETTINGS.sensitivity < max(search.worst(fastest, search.slow))
    assert max(search.worst(calm, [*search.cases, *search.slow])) <= SETTINGS.sensitivity
    assert calm.bandwidth > 10.0
    assert (quick.damping, quick.jerk) == (QUICK_DAMPING, QUICK_JERK)
    assert max(search.worst(quick, search.cases)) <= SETTINGS.sensitivity


def test_observer_behind_a_slow_position_transducer_is_slower() -> None:
    jerks = []
    for lag in (0.0, 0.001, 0.012):
        table = TABLE.with_values({"effects.position_sensor_lag.time_constant": lag})
        jerks.append(Search([table], SETTINGS).design(10.0, 0.3, 1.0).observer.jerk_noise)
    assert jerks == [1.0, 1.0, 0.1]
