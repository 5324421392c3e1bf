"""What dynamic friction is for: each phenomenon of thesis figures 3.6–3.10, on the block of the LuGre paper."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.packing import record
from shake_ros.physics.friction import FRICTIONS, steady_force
from shake_ros.physics.friction.response import break_away_force, pulled_block, under_motion
from shake_ros.settings import load_variant


@pytest.fixture(scope="module")
def block():
    return load_variant("friction", "lugre_paper", FRICTIONS)[1]


@pytest.fixture(scope="module")
def p(block):
    return record("friction", FRICTIONS, block)


def test_stribeck_curve_falls_from_break_away_to_coulomb_and_rises_with_viscosity(p):
    speeds = np.geomspace(1e-6, 1.0, 60)
    force = np.array([steady_force(p, v) for v in speeds])
    lowest = int(np.argmin(force))
    assert force[0] == pytest.approx(1.5, rel=1e-3)
    assert force[lowest] == pytest.approx(1.0, rel=5e-3)
    assert np.all(np.diff(force[: lowest + 1]) <= 0.0)
    assert np.all(np.diff(force[lowest:]) >= 0.0)


def test_before_sliding_the_contact_is_a_spring_that_keeps_a_loop(p):
    dt, travel = 1e-4, 3e-6  # F_s/σ_0 is 15 µm
    t = np.arange(20_001) * dt
    velocity = travel * np.pi * np.sin(2.0 * np.pi * t)
    position = travel * 0.5 * (1.0 - np.cos(2.0 * np.pi * t))
    force = under_motion(p, velocity, dt)
    quarter = 2500
    assert force[quarter] / position[quarter] == pytest.approx(1e5, rel=0.1)  # σ_0
    assert np.sum(force[10_000:] * velocity[10_000:]) * dt > 0.0


def test_friction_lags_the_velocity(p):
    """Frictional lag (figure 3.7): higher while speeding up than while slowing down, more so when it goes faster."""
    dt = 1e-5
    areas = []
    for omega in (1.0, 10.0, 25.0):
        t = np.arange(round(4.0 * np.pi / omega / dt)) * dt
        velocity = 2e-3 * (1.0 + 0.9 * np.cos(omega * t))
        force = under_motion(p, velocity, dt)
        last = slice(len(t) // 2, None)
        up = np.gradient(velocity[last]) > 0.0
        middle = np.abs(velocity[last] - 2e-3) < 2e-4
        areas.append(force[last][up & middle].mean() - force[last][~up & middle].mean())
    assert 0.0 < areas[0] < areas[1] < areas[2]


def test_break_away_force_falls_with_the_rate_of_the_force(p):
    stiffness, forces = 1000.0, []
    for rate in (1.0, 5.0, 50.0):  # N/s
        dt = 2e-5
        pull = rate / stiffness * np.arange(round(4.0 / rate / dt)) * dt
        forces.append(break_away_force(pulled_block(p, 1.0, stiffness, pull, dt, 10), 1e-4))
    assert forces[0] == pytest.approx(1.5, rel=0.06)
    assert forces[0] > forces[1] > forces[2] > 1.0


def test_force_over_velocity_is_a_loop_when_the_direction_changes(p):
    dt = 1e-5
    t = np.arange(200_000) * dt
    velocity = 2e-3 * np.sin(2.0 * np.pi * t)
    force = under_motion(p, velocity, dt)[100_000:]
    v = velocity[100_000:]
    near = np.abs(v) < 2e-5
    falling = np.gradient(v) < 0.0
    assert force[near & falling].mean() > 0.5  # still the old direction's
    assert force[near & ~falling].mean() < -0.5


def spring_pulled(law, stiffness, seconds, dt=1e-4):
    """A block of 1 kg that a spring pulls at 1 mm/s."""
    pull = 1e-3 * np.arange(round(seconds / dt)) * dt
    return pulled_block(record("friction", FRICTIONS, law), 1.0, stiffness, pull, dt, 10)


def test_a_block_sticks_and_slips_at_one_millimetre_per_second(block):
    rows = spring_pulled(block, stiffness=100.0, seconds=60.0)
    later = rows[len(rows) // 2 :]
    stuck = np.abs(later[:, 1]) < 2e-4
    assert int(np.sum(~stuck[1:] & stuck[:-1])) >= 3  # it starts again and again
    assert 0.5 < stuck.mean() < 0.99
    assert later[:, 1].max() > 10e-3
    assert later[:, 2].max() == pytest.approx(1.5, rel=0.05)  # break-away
    assert np.mean(later[:, 1]) == pytest.approx(1e-3, rel=0.2)


def test_without_a_stribeck_hump_the_block_slides_evenly(block):
    flat = block.replace(static_level=1.0, static_level_reverse=1.0, viscous=20.0, viscous_reverse=20.0)
    rows = spring_pulled(flat, stiffness=100.0, seconds=20.0)
    np.testing.assert_allclose(rows[-2000:, 1], 1e-3, rtol=0.01)
