"""The hydraulic side of the right-hand side: ports, pipelines, leakage and the pressures of the chambers, (6.5)–(6.14).

Each effect on the oil or the valve stands at its place; `p` is one record of plant/parameters.py. Verified against
the same equations written a second time (benchmarks/plant/reference_model.py).
"""

from __future__ import annotations

import math

from shake_ros.core.bulk_modulus import modulus
from shake_ros.core.bulk_modulus.ifas import mixture
from shake_ros.core.bulk_modulus.law import CONSTANT
from shake_ros.core.compiled import inlined_kernel, kernel
from shake_ros.core.effects.hydraulics import exchanged, lightness, stiffness, thickness, warmer
from shake_ros.core.effects.hydraulics import factor as soft_zone_factor
from shake_ros.core.effects.unlisted import (
    FLOW_GAIN_OF_OPENING,
    FLOW_GAIN_OF_TIME,
    LEAKAGE_OF_LOAD_PRESSURE,
    STIFFNESS_OF_LOAD_PRESSURE,
    SUPPLY_OF_PHASE,
)
from shake_ros.core.effects.unlisted import value as unlisted
from shake_ros.core.effects.valve import effective_spool, effective_underlap, flow_factor
from shake_ros.core.plant.cylinder import chamber_volumes, load_pressure
from shake_ros.core.plant.options import chamber_pressure, half_line_volume, line_flow_rate
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.states import (
    LINE_FLOW_A,
    LINE_FLOW_B,
    LINE_PRESSURE_A,
    LINE_PRESSURE_B,
    PRESSURE_A,
    PRESSURE_B,
    PRESSURE_SUPPLY,
    SPOOL,
)
from shake_ros.core.valve.ports import opening, sroot


@inlined_kernel
def port_flows(p, spool, clock, pressure_a, pressure_b, pressure_supply):
    """Flow into A, out of B, and drawn from the supply (3.17), (6.12) [m³/s] at a time of the recording [s]."""
    x_e = effective_spool(spool, p.spool_deadband_width)
    c_v = p.valve_flow_coefficient * flow_factor(spool, p.asymmetric_flow_gain_asymmetry)
    load = load_pressure(p, pressure_a, pressure_b)
    c_v *= (
        1.0
        + unlisted(p, FLOW_GAIN_OF_OPENING, spool, pressure=load, clock=clock)
        + unlisted(p, FLOW_GAIN_OF_TIME, clock, opening=spool, pressure=load)
    )
    delta = p.valve_laminar_pressure
    if p.oil_warming_rate != 0.0:
        rise = warmer(clock, p.oil_warming_rate)
        lighter = lightness(rise, p.oil_warming_expansion)
        c_v /= math.sqrt(lighter)
        delta *= thickness(rise, p.oil_warming_viscosity_decay) ** 2 / lighter
    p_t = p.supply_tank_pressure + p.tank_back_pressure_pressure
    d_e = effective_underlap(p.valve_underlap, p.spool_deadband_width, p.spool_deadband_closed)
    plus = c_v * opening(x_e, d_e, p.valve_radial_clearance)
    minus = c_v * opening(-x_e, d_e, p.valve_radial_clearance)
    a_from_supply = plus * sroot(pressure_supply - pressure_a, delta) if plus > 0.0 else 0.0
    a_to_tank = minus * sroot(pressure_a - p_t, delta) if minus > 0.0 else 0.0
    b_to_tank = plus * sroot(pressure_b - p_t, delta) if plus > 0.0 else 0.0
    b_from_supply = minus * sroot(pressure_supply - pressure_b, delta) if minus > 0.0 else 0.0
    return a_from_supply - a_to_tank, b_to_tank - b_from_supply, a_from_supply + b_from_supply


def underlap_left(table: TableParameters) -> float:
    """Underlap that is open in the middle of a table's valve, with what a dead band closes taken off [-]."""
    width, closed = (table.value(f"effects.spool_deadband.{name}") for name in ("width", "closed"))
    return max(float(effective_underlap(table.value("valve.underlap"), width, closed)), 0.0)


@kernel
def oil_modulus(p, pressure):
    """E of the table's law, without effects [Pa]."""
    return p.bulk_modulus_modulus if p.bulk_modulus_kind == CONSTANT else modulus(p, pressure)


@kernel
def fluid_modulus(p, pressure):
    """E of the oil at a pressure: the law's, with pressure and air of the effects on top [Pa].

    Pressure and air act on the law's E at this pressure as on a constant one: exact for a constant law, and for any
    law without air.
    """
    e = oil_modulus(p, pressure)
    m, alpha = p.pressure_dependent_bulk_modulus_slope, p.entrained_air_fraction
    if m != 0.0 or alpha != 0.0:
        e = mixture(pressure, e, m, alpha, p.entrained_air_polytropic_exponent, p.bulk_modulus_reference_pressure)
    return e


@kernel
def softness(p, p_a, p_b):
    """h of (6.20) at both pressures [-]."""
    p_l = load_pressure(p, p_a, p_b)
    return soft_zone_factor(p_l, p.soft_zone_depth, p.soft_zone_threshold, p.soft_zone_sharpness)


@inlined_kernel
def chamber_moduli(p, p_a, p_b):
    """E that acts in chambers A and B: `fluid_modulus`, softened by the soft zone [Pa]."""
    if p.pressure_dependent_bulk_modulus_slope != 0.0 or p.entrained_air_fraction != 0.0:
        e_a, e_b = fluid_modulus(p, p_a), fluid_modulus(p, p_b)
    else:
        e_a, e_b = oil_modulus(p, p_a), oil_modulus(p, p_b)
    if p.soft_zone_depth != 0.0 and p.soft_zone_exchange == 0.0:
        h = softness(p, p_a, p_b)
        e_a *= h  # (6.18)
        e_b *= h  # (6.19)
    return e_a, e_b


@kernel
def exchange_compliance(p, p_a, p_b):
    """c of the soft zone as volume that the chambers exchange [m³/Pa]; E is that at half the supply pressure."""
    middle = 0.5 * (p.supply_supply_pressure + p.supply_tank_pressure)
    yields = 0.25 * p.body_cylinder_volume / fluid_modulus(p, middle)
    return p.soft_zone_exchange * yields * (1.0 / softness(p, p_a, p_b) - 1.0)


@kernel
def pipeline_flows(p, y, clock, p_a, p_b, p_s, rates):
    """Flow into A, out of B and drawn from the supply [m³/s] with pipelines; their rates into `rates`."""
    p_1, p_2 = chamber_pressure(p, y[LINE_PRESSURE_A]), chamber_pressure(p, y[LINE_PRESSURE_B])
    q_1, q_2, q_s = port_flows(p, y[SPOOL], clock, p_1, p_2, p_s)
    q_a, q_b = y[LINE_FLOW_A], y[LINE_FLOW_B]
    half = half_line_volume(p)
    rates[LINE_PRESSURE_A] = oil_modulus(p, p_1) / half * (q_1 - q_a)
    rates[LINE_PRESSURE_B] = oil_modulus(p, p_2) / half * (q_b - q_2)
    rates[LINE_FLOW_A] = line_flow_rate(p, q_a, p_1, p_a)
    rates[LINE_FLOW_B] = line_flow_rate(p, q_b, p_b, p_2)
    return q_a, q_b, q_s


@inlined_kernel
def pressure_rates(p, y, clock, p_a, p_b, piston, piston_velocity, rates):
    """Ṗ_A and Ṗ_B (6.5), (6.6) into `rates`; returns the flow drawn from the supply [m³/s]."""
    p_s = y[PRESSURE_SUPPLY] if p.supply_droop_resistance != 0.0 else p.supply_supply_pressure
    p_s *= 1.0 + unlisted(p, SUPPLY_OF_PHASE, clock)
    dead = p.dead_volume_volume
    if p.pipelines_length > 0.0:
        q_a, q_b, q_s = pipeline_flows(p, y, clock, p_a, p_b, p_s, rates)
        dead += half_line_volume(p)
    else:
        q_a, q_b, q_s = port_flows(p, y[SPOOL], clock, p_a, p_b, p_s)
    e_a, e_b = chamber_moduli(p, p_a, p_b)
    stiffer = 1.0 + unlisted(p, STIFFNESS_OF_LOAD_PRESSURE, load_pressure(p, p_a, p_b), position=piston, clock=clock)
    v_a, v_b = chamber_volumes(p, piston, dead)
    internal, external = p.leakage_internal, p.leakage_external
    if p.oil_warming_rate != 0.0:
        rise = warmer(clock, p.oil_warming_rate)
        stiffer *= stiffness(rise, p.oil_warming_modulus_slope)
        thinner = 1.0 / thickness(rise, p.oil_warming_viscosity_decay)
        internal, external = internal * thinner, external * thinner
    across = internal * (p_a - p_b)  # (3.25)
    if p.turbulent_leakage_coefficient != 0.0:
        across += p.turbulent_leakage_coefficient * sroot(p_a - p_b, p.valve_laminar_pressure)
    across += unlisted(p, LEAKAGE_OF_LOAD_PRESSURE, p_a - p_b, position=piston, clock=clock)
    swept = p.body_piston_area * piston_velocity
    rates[PRESSURE_A] = stiffer * e_a / v_a * (q_a - external * p_a - across - swept)  # (6.5), (3.23)
    rates[PRESSURE_B] = (
        stiffer * e_b / v_b * (-q_b - external * p_b + across + p.body_area_ratio * swept)
    )  # (6.6), (3.23)
    if p.soft_zone_exchange != 0.0 and p.soft_zone_depth != 0.0:
        k_a, k_b, compliance = stiffer * e_a / v_a, stiffer * e_b / v_b, exchange_compliance(p, p_a, p_b)
        rates[PRESSURE_A], rates[PRESSURE_B] = exchanged(
            rates[PRESSURE_A], rates[PRESSURE_B], k_a, k_b, compliance, p.body_area_ratio
        )
    return q_s
