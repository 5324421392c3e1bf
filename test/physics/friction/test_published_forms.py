"""The laws against the closed forms they are published as."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.packing import record
from shake_ros.physics.friction import (
    FRICTIONS,
    armstrong,
    coulomb_viscous_static,
    marton_lantos,
    modified_lugre,
    steady_force,
)
from shake_ros.physics.friction.armstrong import Armstrong
from shake_ros.physics.friction.bo_pavelescu import BoPavelescu
from shake_ros.physics.friction.coulomb_viscous_static import CoulombViscousStatic
from shake_ros.physics.friction.hess_soom import HessSoom
from shake_ros.physics.friction.marton_lantos import MartonLantos
from shake_ros.physics.friction.modified_lugre import ModifiedLuGre
from shake_ros.physics.friction.response import at_rest, step, under_motion
from shake_ros.physics.friction.tustin import Tustin
from shake_ros.settings import load_variant

CURVE = {"coulomb_level": 80.0, "static_level": 240.0, "viscous": 30.0, "transition_velocity": 1e-6}


def test_classical_law_is_coulomb_and_a_power_of_the_velocity():
    p = record("friction", FRICTIONS, CoulombViscousStatic(**CURVE, viscous_exponent=1.5))
    assert steady_force(p, 0.25) == pytest.approx(80.0 + 30.0 * 0.25**1.5)
    assert steady_force(p, -0.25) == pytest.approx(-80.0 - 30.0 * 0.25**1.5)


def test_static_friction_equals_the_external_force_until_it_breaks_away():
    assert coulomb_viscous_static.at_rest(100.0, 240.0) == 100.0
    assert coulomb_viscous_static.at_rest(-500.0, 240.0) == -240.0


def test_hess_and_soom_has_half_its_hump_at_the_stribeck_velocity():
    p = record("friction", FRICTIONS, HessSoom(**CURVE, stribeck_velocity=0.01))
    assert steady_force(p, 0.01) == pytest.approx(80.0 + 80.0 + 0.3)


def test_bo_and_pavelescu_with_exponent_one_is_tustin():
    p = record("friction", FRICTIONS, BoPavelescu(**CURVE, stribeck_velocity=0.4, stribeck_exponent=1.0))
    q = record("friction", FRICTIONS, Tustin(80.0, 160.0, 2.5, 30.0, 1e-6))
    for v in (-1.0, -0.02, 0.003, 0.5):
        assert steady_force(p, v) == pytest.approx(steady_force(q, v), rel=1e-12)


def test_marton_and_lantos_touch_tustin_at_rest_and_at_the_largest_velocity_and_stay_below():
    p = record("friction", FRICTIONS, MartonLantos(**CURVE, stribeck_velocity=0.1, largest_velocity=0.5))
    q = record("friction", FRICTIONS, Tustin(80.0, 160.0, 10.0, 30.0, 1e-6))
    for v in (1e-4, 0.5):
        assert steady_force(p, v) == pytest.approx(steady_force(q, v), rel=1e-4)
    between = [(steady_force(p, v), steady_force(q, v)) for v in np.linspace(0.01, 0.49, 40)]
    assert all(lines < curve for lines, curve in between)


def test_marton_and_lantos_switch_where_the_lines_meet():
    p = record("friction", FRICTIONS, MartonLantos(**CURVE, stribeck_velocity=0.1, largest_velocity=0.5))
    v = float(marton_lantos.switch_velocity(p))
    below, at, above = (float(marton_lantos.curve_level(p, v + d)) for d in (-1e-3, 0.0, 1e-3))
    assert (below - at) / 1e-3 == pytest.approx(1600.0, rel=1e-6)  # (F_s − F_C)/x_st
    assert (at - above) / 1e-3 == pytest.approx(1600.0 * math.exp(-5.0), rel=1e-6)


def broken_away(law: Armstrong, dwell: float, dt: float = 1e-4) -> float:
    """Largest force of a slow push after sliding fast, an abrupt stop and a rest of `dwell` [N]."""
    p = record("friction", FRICTIONS, law)
    state = at_rest(p)
    for _ in range(2000):
        step(p, state, 0.5 * dt, 0.5, 0.5, dt)
    step(p, state, -1e-6, 0.5, 0.0, dt)  # a little back, so that the contact holds
    for _ in range(round(dwell / dt)):
        step(p, state, 0.0, 0.0, 0.0, dt)
    return max(float(step(p, state, 1e-7, 1e-3, 1e-3, dt)) for _ in range(2000))


def test_armstrongs_break_away_rises_with_the_dwell_time_as_published():
    law = Armstrong(80.0, 160.0, 0.01, 0.0, 1e7, 5e-3, rise_time=1.0)
    stop = 160.0 / (1.0 + 50.0**2)  # F_sa: the lagged speed still is 0.5 m/s when the contact holds
    for dwell in (0.5, 3.0):
        expected = 80.0 + stop + (160.0 - stop) * dwell / (dwell + 1.0)  # (3.41)
        assert broken_away(law, dwell) == pytest.approx(expected, rel=0.03)


def test_armstrongs_contact_is_a_spring_before_it_slides():
    p = record("friction", FRICTIONS, Armstrong(80.0, 160.0, 0.01, 0.0, 1e7, 5e-3, rise_time=1.0))
    assert armstrong.contact_deflection(p, 0.0, 3e-6, 0.0, 0.0, 0.0, 0.0, 160.0) * 1e7 == pytest.approx(30.0)
    assert armstrong.contact_deflection(p, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 160.0) * 1e7 == pytest.approx(240.0)


def test_the_film_is_full_where_the_stribeck_hump_is_gone():
    _, law = load_variant("friction", "modified_lugre", {"modified_lugre": ModifiedLuGre})
    p = record("friction", FRICTIONS, law)
    full = modified_lugre.steady_memory(p, 0.2492)
    assert full == pytest.approx(1.0 - 159.8779 / 348.0091)  # (3.50)
    assert modified_lugre.steady_memory(p, 2.0) == full
    assert modified_lugre.steady_memory(p, 0.2492 / 8.0) == pytest.approx(full / 4.0)


def test_the_film_grows_and_shrinks_with_the_time_constants_of_the_table():
    _, law = load_variant("friction", "modified_lugre", {"modified_lugre": ModifiedLuGre})
    p = record("friction", FRICTIONS, law)
    full = modified_lugre.steady_memory(p, 0.2492)
    assert modified_lugre.memory_rate(p, 0.2492, 0.0) == pytest.approx(full / 0.0152)
    assert modified_lugre.memory_rate(p, 1e-3, 1.0) < 0.0
    assert modified_lugre.memory_rate(p, 0.0, 1.0) == pytest.approx(-1.0 / 31.0163)


def test_the_lead_of_the_fluid_friction_is_in_phase_with_the_acceleration():
    from shake_ros.physics.friction import FRICTIONS

    with_lead = load_variant("friction", "new_modified_lugre", FRICTIONS)[1]
    t = np.arange(10_000) * 1e-4
    velocity = 0.2 + 0.1 * np.sin(2.0 * np.pi * 2.0 * t)
    lead = under_motion(record("friction", FRICTIONS, with_lead), velocity, 1e-4)
    none = under_motion(record("friction", FRICTIONS, with_lead.replace(fluid_time=0.0)), velocity, 1e-4)
    slope = np.diff(velocity) / 1e-4
    np.testing.assert_allclose((lead - none)[1:], 5775.1 * 0.85 * slope, rtol=1e-6, atol=1e-6)
