"""The simplified valve and its ports against closed forms and the catalogue."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.right_hand_side import port_flows
from shake_ros.physics.plant.simulation import run
from shake_ros.physics.valve.ports import opening, sroot
from shake_ros.physics.valve.simplified import backlash, spool_acceleration
from shake_ros.settings import load_table

BERGAMO = load_table("bergamo")


def flows(spool: float, p_a: float, p_b: float, **changes: float) -> tuple[float, float, float]:
    table = BERGAMO.with_values({f"valve.{name}": value for name, value in changes.items()})
    return port_flows(records(table.vector())[0], spool, 0.0, p_a, p_b, BERGAMO.supply.supply_pressure)


def test_root_is_odd_laminar_near_zero_and_the_root_beyond() -> None:
    assert sroot(0.0, 5e4) == 0.0
    for drop in (1.0, 1e3, 5e4, 1e6, 2e7):
        assert sroot(-drop, 5e4) == -sroot(drop, 5e4)
        assert sroot(drop, 5e4) < math.sqrt(drop)
    assert sroot(2.0, 5e4) == pytest.approx(2.0 * sroot(1.0, 5e4), rel=1e-6)
    assert sroot(1e7, 5e4) == pytest.approx(math.sqrt(1e7), rel=1e-4)


def test_edges_open_linearly_overlap_by_the_underlap_and_never_exceed_full() -> None:
    places = np.linspace(-1.2, 1.2, 481)
    g = np.array([opening(s, 0.005) for s in places])
    assert g.min() == 0.0
    assert g.max() == 1.0
    assert np.all(np.diff(g) >= 0.0)
    assert opening(0.0, 0.005) == 0.005
    assert opening(0.004, -0.005) == 0.0  # overlap


@pytest.mark.parametrize(
    ("width", "closed", "leaking"), [(0.0, 1.0, 0.005), (0.02, 1.0, 0.0), (0.02, 0.0, 0.005), (0.002, 1.0, 0.003)]
)
def test_wide_lands_close_the_centre_and_a_dead_band_of_the_electronics_does_not(
    width: float, closed: float, leaking: float
) -> None:
    table = BERGAMO.with_values({"effects.spool_deadband.width": width, "effects.spool_deadband.closed": closed})
    p, supply = records(table.vector())[0], BERGAMO.supply.supply_pressure
    middle = 0.5 * (supply + BERGAMO.supply.tank_pressure)
    full = 1.81e-7 * math.sqrt(supply - middle)
    for spool, carried in [(0.0, leaking), (0.9 * width, leaking), (width + 0.1, 0.1 + leaking)]:
        into_a, out_of_b, drawn = port_flows(p, spool, 0.0, middle, middle, supply)
        against = max(leaking - max(spool - width, 0.0), 0.0)  # the edge that closes
        assert into_a == pytest.approx((carried - against) * full, rel=1e-3, abs=1e-12)
        assert out_of_b == into_a
        assert drawn == pytest.approx((carried + against) * full, rel=1e-3, abs=1e-12)


def test_catalogue_flow_of_20_litres_a_minute_at_70_bar() -> None:
    # 35 bar over each edge, full opening; the table's C_v of 1.81e-7 gives 20.3 l/min
    supply = BERGAMO.supply.supply_pressure
    q_a, q_b, q_s = flows(1.0, supply - 35e5, BERGAMO.supply.tank_pressure + 35e5)
    assert q_a * 60e3 == pytest.approx(20.0, rel=0.02)
    assert q_b == pytest.approx(q_a, rel=1e-12)
    assert q_s == pytest.approx(q_a, rel=1e-12)


def test_flows_by_hand_with_a_quarter_opening() -> None:
    # (6.12) at x_s = 0.25, P_A = 80 bar, P_B = 120 bar, P_s = 206 bar, P_T = 1 bar
    q_a, q_b, q_s = flows(0.25, 80e5, 120e5, underlap=0.0)
    assert q_a == pytest.approx(1.81e-7 * 0.25 * math.sqrt(126e5), rel=1e-4)
    assert q_b == pytest.approx(1.81e-7 * 0.25 * math.sqrt(119e5), rel=1e-4)
    assert q_s == q_a


def test_mirrored_spool_swaps_the_chambers() -> None:
    for spool in (0.003, 0.2, 0.9):
        q_a, q_b, q_s = flows(spool, 60e5, 150e5)
        m_a, m_b, m_s = flows(-spool, 150e5, 60e5)
        assert (m_a, m_b, m_s) == pytest.approx((-q_b, -q_a, q_s), rel=1e-12)


def test_an_underlapped_valve_at_null_passes_the_same_through_both_edges() -> None:
    middle = 0.5 * (BERGAMO.supply.supply_pressure + BERGAMO.supply.tank_pressure)
    q_a, q_b, q_s = flows(0.0, middle, middle)
    assert q_a == pytest.approx(0.0, abs=1e-18)
    assert q_b == pytest.approx(0.0, abs=1e-18)
    assert q_s == pytest.approx(2.0 * 1.81e-7 * 0.005 * math.sqrt(102.5e5), rel=1e-4)
    assert flows(0.0, middle, middle, underlap=-0.005) == (0.0, 0.0, 0.0)


def test_spool_answers_a_small_step_as_a_second_order_lag() -> None:
    table = BERGAMO.with_values({"valve.hysteresis": 0.0})
    omega, damping, step = 1600.0, 0.736, 0.05
    result = run(table, np.full(100, step), 1e-4)
    t = 1e-4 * np.arange(100)
    ringing = omega * math.sqrt(1.0 - damping**2)
    closed = 1.0 - np.exp(-damping * omega * t) * (
        np.cos(ringing * t) + damping * omega / ringing * np.sin(ringing * t)
    )
    np.testing.assert_allclose(result[:, 6], step * closed, atol=1e-4 * step)


def test_spool_rests_where_it_is_wanted() -> None:
    assert spool_acceleration(0.3, 0.0, 0.3, 1600.0, 0.7) == 0.0
    assert spool_acceleration(0.2, 0.0, 0.3, 1600.0, 0.7) > 0.0
    assert spool_acceleration(0.3, 5.0, 0.3, 1600.0, 0.7) < 0.0


def test_spool_is_no_faster_than_its_rate_limit_and_stays_in_its_stroke() -> None:
    slow = BERGAMO.with_values({"valve.rate_limit": 200.0})
    result = run(slow, np.concatenate([np.ones(300), -np.ones(300)]), 1e-4)
    assert np.max(np.abs(np.diff(result[:, 6]))) <= 200.0 * 1e-4 * 1.0001
    assert np.max(np.abs(result[:, 6])) <= 1.0 + 1e-12
    assert result[299, 6] == pytest.approx(1.0, abs=0.002)


def test_backlash_follows_only_when_pushed() -> None:
    held, path = 0.0, []
    for wanted in (0.05, 0.2, 0.15, 0.0, -0.2):
        held = backlash(held, wanted, 0.1)
        path.append(held)
    assert path == pytest.approx([0.0, 0.1, 0.1, 0.1, -0.1])


def test_hysteresis_leaves_the_spool_behind_by_its_half_width_on_both_ways() -> None:
    table = BERGAMO.with_values({"valve.hysteresis": 0.02})
    rising, falling = np.linspace(0.0, 0.3, 300), np.linspace(0.6, 0.3, 300)
    up = run(table, np.append(rising, np.full(60, 0.3)), 1e-3)[-1, 6]
    down = run(table, np.concatenate([2.0 * rising, falling, np.full(60, 0.3)]), 1e-3)[-1, 6]
    assert up == pytest.approx(0.28, abs=1e-4)
    assert down == pytest.approx(0.32, abs=1e-4)
