"""The soft zone of the thesis takes up work around a closed cycle of the pressures; exchanged volume does not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import dblquad, simpson

from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.right_hand_side import active_states, right_hand_side
from shake_ros.physics.plant.simulation import initial_state, run
from shake_ros.physics.plant.states import CONTINUOUS, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.settings import load_table
from shake_ros.thesis.bulk_modulus import compliance, work_of_cycle

SWING = 30e5  # [Pa]
THESIS = load_table("bergamo_table_6_9")
EXCHANGED = THESIS.with_values({"effects.soft_zone.exchange": 1.0})
ZONE = {"effects.soft_zone.depth": 0.84}


def test_the_thesis_law_takes_up_work_one_way_round_and_makes_it_the_other_way() -> None:
    for table in (THESIS, load_table("bergamo").with_values(ZONE)):
        taken = work_of_cycle(table, SWING)
        assert abs(taken) > 10.0  # J
        assert work_of_cycle(table, SWING, backwards=True) == pytest.approx(-taken, rel=1e-9)


def test_the_work_is_the_double_integral_of_the_curl() -> None:
    table = load_table("bergamo").with_values(ZONE)
    d, edge, mu = 0.84, 9.177e5, 8.8e-6

    def softer(load: float) -> float:  # 1/h
        step = np.tanh(mu * (load + edge)) - np.tanh(mu * (load - edge))
        return 1.0 / (1.0 - 0.5 * d * step / np.tanh(mu * edge))

    def curl(p_b: float, p_a: float) -> float:
        slope = (softer(p_a - p_b + 1e3) - softer(p_a - p_b - 1e3)) / 2e3
        return (p_a + p_b) * slope

    rest = 0.5 * 207e5
    found, _ = dblquad(curl, rest, rest + SWING, rest, lambda p_a: p_a, epsrel=1e-4)
    assert work_of_cycle(table, SWING) == pytest.approx(1.2293e-4 / 1.16e9 * found, rel=1e-3)


@pytest.mark.parametrize("ratio", [1.0, 0.6])
def test_exchanged_volume_leaves_nothing(ratio: float) -> None:
    table = EXCHANGED.with_values({"body.area_ratio": ratio})
    assert abs(work_of_cycle(table, SWING)) < 1e-3
    assert abs(work_of_cycle(table.without(["soft_zone"]), SWING)) < 1e-3


@pytest.mark.parametrize("ratio", [1.0, 0.6])
@pytest.mark.parametrize("law", ["thesis", "exchanged"])
def test_the_plants_pressures_follow_this_compliance(law: str, ratio: float) -> None:
    sealed = {"valve.underlap": -0.1, "leakage.internal": 0.0, "leakage.external": 0.0, "body.area_ratio": ratio}
    vector = (THESIS if law == "thesis" else EXCHANGED).with_values(sealed)
    for p_a, p_b in ((9e6, 9.4e6), (8e6, 12e6)):
        p, y, rates = records(vector.vector())[0], initial_state(vector.vector()), np.zeros(CONTINUOUS)
        y[VELOCITY], y[PRESSURE_A], y[PRESSURE_B] = 0.1, p_a, p_b
        right_hand_side(p, y, y, 0.0, 0.0, active_states(p), rates)
        swept = 0.1 * vector.body.piston_area
        flows = compliance(vector, p_a, p_b) @ np.array([rates[PRESSURE_A], rates[PRESSURE_B]])
        assert flows == pytest.approx([-swept, ratio * swept], rel=1e-9)


def test_both_are_equally_soft_where_the_piston_swings_about_mid_stroke() -> None:
    # with a constant E: opposite changes of the two pressures meet V/(E h) and V/E + 2 c
    one = load_table("bergamo").with_values(ZONE)
    other = one.with_values({"effects.soft_zone.exchange": 1.0})
    for load in (0.0, 8e5, 30e5):
        pressures = 0.5 * (207e5 + load), 0.5 * (207e5 - load)
        swing = np.array([1.0, -1.0])
        assert compliance(one, *pressures) @ swing == pytest.approx(compliance(other, *pressures) @ swing, rel=1e-9)


def test_what_a_run_puts_into_exchanged_volume_is_a_function_of_the_load_pressure_at_its_end() -> None:
    dt, shut = 1e-4, {"valve.underlap": -0.2, "leakage.internal": 0.0, "leakage.external": 0.0}
    table = load_table("bergamo").with_values(ZONE | shut | {"effects.soft_zone.exchange": 1.0})
    t = dt * np.arange(4001)
    force = 3000.0 * np.sin(np.pi * t / t[-1]) ** 2 * np.sin(2.0 * np.pi * 12.0 * t)
    out = run(table, np.zeros(len(t)), dt, forces=force, tolerance=1e-9)
    x, v, p_a, p_b = (out[:, i] for i in (0, 1, 3, 4))
    load = p_a - p_b
    given = -9.4562e-4 * simpson(load * v, dx=dt)
    in_oil = sum(
        simpson(p * volume / 1.16e9 * np.gradient(p, dt, edge_order=2), dx=dt)
        for p, volume in ((p_a, 1.2293e-4 + 9.4562e-4 * x), (p_b, 1.2293e-4 - 9.4562e-4 * x))
    )
    softest = 1.2293e-4 / 1.16e9 / 2.0 * (1.0 / (1.0 - 0.84) - 1.0)  # c where the load pressure is small
    assert abs(load[-1]) < 2e5
    assert np.max(np.abs(load)) > 50e5
    assert given == pytest.approx(in_oil + 0.5 * softest * load[-1] ** 2, abs=1e-4)
    assert 9.4562e-4 * simpson(np.abs(load * v), dx=dt) > 10.0  # J that went in and out
