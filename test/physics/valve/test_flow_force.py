"""Axial flow force on the spool: the momentum of each jet, the inertia of the oil, valve and table against Radau."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from valve_of_the_sheet import SUPPLY, TANK, rates_of_the_sheet, step

from benchmarks.plant import reference_model as reference
from shake_ros.packing import record
from shake_ros.physics.plant.simulation import run
from shake_ros.physics.valve import VALVES, detailed, valve_response
from shake_ros.physics.valve.ports import flow_force, flow_rates, no_load, steady_force
from shake_ros.settings import load_table, load_variant

DECLARED = load_variant("valve", "detailed", VALVES)[1]
JETS = DECLARED.replace(flow_force_stiffness=0.0, jet_cosine=0.358)
WHOLE = JETS.replace(damping_length_a=0.012, damping_length_b=-0.004)
LOADS = [(1.2e7, 8e6), (4e6, 1.6e7), (2.3e7, 3e6)]  # P_A, P_B [Pa]; the last one above the supply's pressure


def parameters(valve):
    return record("valve", VALVES, valve)


def edges(valve, x_s, p_a, p_b):
    """(way, Q [m³/s], Δp [Pa]) of the four edges by (3.17), turbulent: way is where the edge opens."""
    shares = [min(max(way * x_s + valve.underlap, 0.0), 1.0) for way in (1.0, 1.0, -1.0, -1.0)]
    drops = [SUPPLY - p_a, p_b - TANK, p_a - TANK, SUPPLY - p_b]
    flows = [
        valve.flow_coefficient * g * math.copysign(math.sqrt(abs(d)), d) for g, d in zip(shares, drops, strict=True)
    ]
    return list(zip((1.0, 1.0, -1.0, -1.0), flows, drops, strict=True))


@pytest.mark.parametrize("spool", [-0.9, -0.3, 0.002, 0.5, 1.0])
@pytest.mark.parametrize("load", LOADS)
def test_steady_force_is_the_momentum_that_the_jets_carry_away(spool, load) -> None:
    momentum = 0.0
    for way, flow, drop in edges(JETS, spool, *load):
        speed = math.copysign(math.sqrt(2.0 * abs(drop) / JETS.density), drop)  # of a loss-free jet
        momentum += way * JETS.density * flow * speed * 0.358
    found = steady_force(parameters(JETS), spool, (*load, 0.0, 0.0), SUPPLY, TANK)
    assert found == pytest.approx(momentum, rel=1e-3)


def test_steady_force_of_an_open_valve_is_merritts_spring() -> None:
    """2 C_d w cos θ (P_s − P_L) x for both edges, with C_d w from the flow coefficient."""
    x, load = 0.4 * JETS.spool_stroke, 3e6
    width = JETS.flow_coefficient / (0.61 * JETS.spool_stroke) * math.sqrt(0.5 * JETS.density)
    middle = 0.5 * (SUPPLY + TANK)
    ports = (middle + 0.5 * load, middle - 0.5 * load, 0.0, 0.0)
    spring = 2.0 * 0.61 * width * 0.358 * (SUPPLY - TANK - load) * x
    assert steady_force(parameters(JETS.replace(underlap=0.0)), 0.4, ports, SUPPLY, TANK) == pytest.approx(
        spring, rel=1e-3
    )


@pytest.mark.parametrize("spool", [-0.6, 0.0, 0.3])
@pytest.mark.parametrize("load", LOADS)
def test_transient_force_is_the_inertia_of_the_oil_that_speeds_up(spool, load) -> None:
    """Against the difference quotient of ρ (L_A Q_A + L_B Q_B), the momentum of the oil on its way."""
    rate, rates, h = 30.0, (4e8, -2.5e8), 1e-7

    def momentum(t):
        flows = edges(WHOLE, spool + rate * t, load[0] + rates[0] * t, load[1] + rates[1] * t)
        into_a, out_of_b = flows[0][1] - flows[2][1], flows[1][1] - flows[3][1]
        return WHOLE.density * (0.012 * into_a - 0.004 * out_of_b)

    expected = (momentum(h) - momentum(-h)) / (2.0 * h)
    p, ports = parameters(WHOLE), (*load, *rates)
    found = flow_force(p, spool, rate, ports, SUPPLY, TANK) - steady_force(p, spool, ports, SUPPLY, TANK)
    assert found == pytest.approx(expected, rel=5e-3, abs=1e-3)


def test_both_ports_of_a_symmetric_valve_gain_the_same_flow() -> None:
    into_a, out_of_b = flow_rates(parameters(WHOLE), 0.3, 20.0, no_load(SUPPLY, TANK), SUPPLY, TANK)
    assert into_a == pytest.approx(out_of_b, rel=1e-12)
    assert into_a > 0.0


def test_without_cosine_and_lengths_no_bit_changes() -> None:
    command = 0.3 * np.sin(2.0 * np.pi * 20.0 * np.arange(400) * 1e-4)
    same = DECLARED.replace(jet_cosine=0.0, damping_length_a=0.0, damping_length_b=0.0)
    p, y, rates = parameters(same), detailed.valve_at_rest(parameters(DECLARED), SUPPLY, TANK), np.zeros((2, 8))
    y[detailed.SPOOL] = 1e-4
    for i, load in enumerate(((1e7, 1e7, 0.0, 0.0), (2e7, 1e5, 1e9, -1e9))):
        detailed.valve_rates(p, y, 0.1, SUPPLY, TANK, load, rates[i])
    np.testing.assert_array_equal(rates[0], rates[1])
    assert np.isfinite(valve_response(same, command, 1e-4, SUPPLY, TANK)).all()


def test_a_way_that_damps_slows_the_spool_and_one_that_drives_quickens_it() -> None:
    def overshoot(way):
        valve = JETS.replace(damping_length_a=way, damping_length_b=way)
        spool = valve_response(valve, step(0.3), 1e-4, SUPPLY, TANK)
        return float(spool.max() / spool[-1])

    assert overshoot(0.03) < overshoot(0.0) < overshoot(-0.03)


def test_valve_and_table_are_within_a_thousandth_of_radau() -> None:
    """One system of twelve equations: the sheet's valve with the momentum formula on its spool, the sheet's table."""
    table = load_table("bergamo").with_sections(valve=WHOLE)
    c = reference.constants()
    samples, sample = 50, 1e-3
    y0 = np.concatenate([reference.at_rest(c)[:4], detailed.valve_at_rest(parameters(WHOLE), c.supply, c.tank)[1:]])

    def rates(_t, y, command):
        p_a, p_b, x_s, v_s = y[2], y[3], y[9], y[10]
        spool, speed = x_s / WHOLE.spool_stroke, v_s / WHOLE.spool_stroke
        of_table = reference.rates((y[0], y[1], p_a, p_b, spool, speed), 0.0, c)
        of_valve = rates_of_the_sheet(WHOLE, np.concatenate([[0.0], y[4:]]), command, c.supply, c.tank)[1:]

        def force_and_flows(s, a, b):
            steady, flows = 0.0, [0.0, 0.0]
            for port, way, drop in (
                (0, 1, c.supply - a),
                (1, 1, b - c.tank),
                (0, -1, a - c.tank),
                (1, -1, c.supply - b),
            ):
                q = c.flow * reference.edge_flow(way * s + c.underlap, drop, c.laminar)
                root = drop / (drop * drop + c.laminar**2) ** 0.25
                steady += way * 0.358 * WHOLE.density * q * math.sqrt(2.0 / WHOLE.density) * root
                flows[port] += way * q
            return steady, flows

        h = 1e-7
        steady = force_and_flows(spool, p_a, p_b)[0]
        later = force_and_flows(spool + h * speed, p_a + h * of_table[2], p_b + h * of_table[3])[1]
        sooner = force_and_flows(spool - h * speed, p_a - h * of_table[2], p_b - h * of_table[3])[1]
        speeding = [(one - other) / (2.0 * h) for one, other in zip(later, sooner, strict=True)]
        inertia = WHOLE.density * (0.012 * speeding[0] - 0.004 * speeding[1])
        of_valve[-1] -= (steady + inertia) / WHOLE.spool_mass
        return [*of_table[:4], *of_valve]

    commands = np.where(np.arange(samples) < 5, 0.0, 0.4)
    scale = np.array([1e-6, 1e-5, 10.0, 10.0, 1e-11, 1e-7, 10.0, 10.0, 10.0, 1e-8, 1e-5])
    solution, y = np.empty((samples, 2)), y0
    for k, command in enumerate(commands):
        solution[k] = y[9] / WHOLE.spool_stroke, rates(0.0, y, command)[1]
        y = solve_ivp(rates, (0.0, sample), y, method="Radau", args=(command,), rtol=1e-6, atol=scale).y[:, -1]
    ours = run(table, commands, sample)
    assert np.abs(ours[:, 6] - solution[:, 0]).max() < 1e-3 * 0.4
    assert reference.nrmse(solution[:, 1], ours[:, 2]) < 3e-3
