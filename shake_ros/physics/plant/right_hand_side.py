"""The one right-hand side of the table: (6.3)–(6.15) with every effect at its place; first the oil, then the motion.

Each effect has a parameter value at which it is absent, so the declared model and every extension are this same
compiled function with other numbers. `p` is one record of plant/parameters.py. Verified against the same equations
written a second time (benchmarks/plant/reference_model.py).
"""

from __future__ import annotations

import math

from shake_ros.compiled import inlined_kernel, kernel
from shake_ros.physics.bulk_modulus import modulus
from shake_ros.physics.bulk_modulus.ifas import mixture
from shake_ros.physics.bulk_modulus.law import CONSTANT
from shake_ros.physics.effects.friction import deflection, dry_level, film_rate
from shake_ros.physics.effects.hydraulics import exchanged, lightness, pressure_rate, stiffness, thickness, warmer
from shake_ros.physics.effects.hydraulics import factor as soft_zone_factor
from shake_ros.physics.effects.structure import base_acceleration, contact_force, has_backlash, spring_force
from shake_ros.physics.effects.unlisted import (
    FLOW_GAIN_OF_OPENING,
    FLOW_GAIN_OF_TIME,
    FORCE_OF_POSITION,
    FORCE_OF_VELOCITY,
    FRICTION_FACTOR_OF_POSITION,
    FRICTION_OF_POSITION,
    LEAKAGE_OF_LOAD_PRESSURE,
    STIFFNESS_OF_LOAD_PRESSURE,
    SUPPLY_OF_PHASE,
    is_of_time,
)
from shake_ros.physics.effects.unlisted import value as unlisted
from shake_ros.physics.effects.valve import effective_spool, effective_underlap, flow_factor
from shake_ros.physics.friction import (
    contact_deflection,
    contact_level,
    curve_direction,
    curve_level,
    has_memory,
    inertia,
    is_dynamic,
    memory_rate,
    micro_damping,
    tustin,
    viscous_coefficient,
)
from shake_ros.physics.friction.tustin import TUSTIN
from shake_ros.physics.plant.cylinder import chamber_volumes, load_pressure
from shake_ros.physics.plant.options import chamber_pressure, foot_force, half_line_volume, line_flow_rate, storey_rates
from shake_ros.physics.plant.states import (
    BASE,
    BASE_RATE,
    BRISTLE,
    CLOCK,
    DECLARED,
    DEFLECTION,
    EXTENDED,
    FILM,
    FRICTION_MEMORY,
    FRICTION_RISE,
    LAGGED_ACCELERATION,
    LAGGED_POSITION,
    LINE_FLOW_A,
    LINE_FLOW_B,
    LINE_PRESSURE_A,
    LINE_PRESSURE_B,
    POSITION,
    PRESSURE_A,
    PRESSURE_B,
    PRESSURE_SUPPLY,
    ROD,
    ROD_RATE,
    SPECIMEN,
    SPECIMEN_RATE,
    SPOOL,
    SPOOL_RATE,
    STOREY,
    VELOCITY,
)
from shake_ros.physics.valve.detailed import DETAILED
from shake_ros.physics.valve.ports import acts, opening, sroot
from shake_ros.physics.valve.simplified import spool_acceleration

SHORTEST_LAG = 1e-4  # [s] of a sensor's state; of a shorter lag, which would only be stiff, the sensor shows a part


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


@kernel
def active_states(p):
    """Number of leading states that these parameters set in motion."""
    if p.frame_storeys > 0.0:
        return STOREY + 2 * int(p.frame_storeys)
    if p.pipelines_length > 0.0:
        return STOREY
    if (
        p.supply_droop_resistance != 0.0
        or p.film_friction_relief != 0.0
        or p.specimen_resonance_mass != 0.0
        or has_backlash(p.coupling_backlash_gap)
        or p.base_flexibility_compliance != 0.0
        or p.accelerometer_lag_time_constant != 0.0
        or p.position_sensor_lag_time_constant != 0.0
        or has_memory(p)
    ):
        return EXTENDED
    return DECLARED


@kernel
def follows_clock(p):
    """Whether the rates depend on the time of the recording."""
    return p.oil_warming_rate != 0.0 or is_of_time(p)


@kernel
def contact_end(p, start, displacement, velocity_start, velocity, memory):
    """Contact state z of a friction law [m] after a displacement of the piston one way from the state `start`."""
    z, rise = start[DEFLECTION], start[FRICTION_RISE]
    return contact_deflection(p, z, displacement, velocity_start, velocity, start[FRICTION_MEMORY], memory, rise)


@kernel
def dry_friction(p, velocity, displacement, start, velocity_start, memory):
    """Dry level [N], signed share of it that acts [-] and damping of the bristles [N], for any law but Tustin's."""
    if is_dynamic(p):
        level = contact_level(p, velocity, memory, start[FRICTION_RISE])
        z = contact_end(p, start, displacement, velocity_start, velocity, memory)
        share = p.friction_contact_stiffness * z / level
        return level, share, micro_damping(p, velocity, share)
    return curve_level(p, velocity), curve_direction(p, velocity), 0.0


@inlined_kernel
def friction_force(p, velocity, position, displacement, start, velocity_start, memory, film, load):
    """Friction on the piston under a load pressure [Pa]: the table's law with the effects on its dry part [N].

    A law with a contact state has its own pre-sliding, so the effect of that name does not act on it.
    """
    micro, viscous = 0.0, p.friction_viscous
    if p.friction_kind == TUSTIN:  # (6.10), first for speed
        dry, sign = tustin.curve_level(p, velocity), tustin.direction(p, velocity)
    else:
        dry, sign, micro = dry_friction(p, velocity, displacement, start, velocity_start, memory)
        viscous = viscous_coefficient(p, velocity)
    if p.oil_warming_rate != 0.0:
        viscous *= thickness(warmer(start[CLOCK], p.oil_warming_rate), p.oil_warming_viscosity_decay)
    if p.presliding_friction_distance > 0.0 and not is_dynamic(p):
        sign = deflection(start[BRISTLE], displacement, p.presliding_friction_distance)
    dry = dry_level(p, dry, position)
    speed, clock = abs(velocity), start[CLOCK]
    dry *= 1.0 + unlisted(p, FRICTION_FACTOR_OF_POSITION, position, velocity=speed, pressure=load, clock=clock)
    dry += unlisted(p, FRICTION_OF_POSITION, position, velocity=speed, pressure=load, clock=clock)
    dry *= 1.0 + p.friction_asymmetry_asymmetry * math.copysign(1.0, sign)
    dry *= 1.0 - p.film_friction_relief * film
    return (
        dry * sign
        + (viscous + p.quadratic_drag_coefficient * abs(velocity)) * velocity
        + micro
        + unlisted(p, FORCE_OF_VELOCITY, velocity, position=position, pressure=load, clock=clock)
    )


@kernel
def end_stop_force(p, position, velocity):
    """Force of the end stops at ±stroke/2; they push only [N]."""
    over = abs(position) - 0.5 * p.body_stroke
    if over <= 0.0:
        return 0.0
    outward = velocity if position > 0.0 else -velocity
    push = max(p.body_end_stop_stiffness * over + p.body_end_stop_damping * outward, 0.0)
    return -push if position > 0.0 else push


@kernel
def right_hand_side(p, y, start, wanted, external_force, n, rates):
    """Rates of the first `n` states, into `rates`.

    Parameters
    ----------
    p : parameter record.
    y : states, shape (≥ n,).
    wanted : spool command behind backlash, gain and null shift [-]; with the detailed valve, which is integrated ahead
        on its own, the speed of its spool over the step [1/s].
    start : whole state at the start of the step, shape (STATES,), from which contact states follow the displacement.
    external_force : along +x [N].
    n : from `active_states`.
    rates : output, shape (≥ n,).

    Returns
    -------
    Absolute acceleration of the table, what an ideal accelerometer reads [m/s²].
    """
    if p.valve_kind == DETAILED:
        rates[SPOOL] = wanted
        rates[SPOOL_RATE] = 0.0
    else:
        omega_v = p.valve_natural_frequency * (1.0 - p.slow_valve_slowdown)
        limit = p.valve_rate_limit
        rates[SPOOL] = min(max(y[SPOOL_RATE], -limit), limit)
        rates[SPOOL_RATE] = spool_acceleration(y[SPOOL], y[SPOOL_RATE], wanted, omega_v, p.valve_damping)  # (3.19)
    return table_rates(p, y, start, external_force, n, rates)


@kernel
def table_rates(p, y, start, external_force, n, rates):
    """`right_hand_side` without the spool, whose motion does not depend on the table: its two rates are left alone.

    A function of its own because the integrator knows the spool in closed form and asks for the rest alone.
    """
    x, v = y[POSITION], y[VELOCITY]
    split = n > DECLARED and has_backlash(p.coupling_backlash_gap)
    piston = x + y[ROD] if split else x
    piston_velocity = v + y[ROD_RATE] if split else v
    p_a, p_b = chamber_pressure(p, y[PRESSURE_A]), chamber_pressure(p, y[PRESSURE_B])
    q_s = pressure_rates(p, y, start[CLOCK], p_a, p_b, piston, piston_velocity, rates)

    film, memory = (y[FILM], y[FRICTION_MEMORY]) if n > DECLARED else (0.0, 0.0)
    moved, velocity_start = x - start[POSITION], start[VELOCITY]
    if split:
        moved += y[ROD] - start[ROD]
        velocity_start += start[ROD_RATE]
    load = load_pressure(p, p_a, p_b)
    friction = friction_force(p, piston_velocity, piston, moved, start, velocity_start, memory, film, load)
    pressure_force = p.body_piston_area * load  # (3.26)
    place = x + y[BASE] if n > DECLARED else x  # to ground
    on_table = external_force + p.constant_force_force - p.stiffness_to_ground_stiffness * place
    on_table -= unlisted(p, FORCE_OF_POSITION, x, velocity=v, clock=start[CLOCK])
    on_rod = pressure_force - friction + end_stop_force(p, piston, piston_velocity)
    declared_mass = p.body_table_mass + p.body_specimen_mass + inertia(p, piston_velocity)  # (6.9)
    mass = max(declared_mass + p.payload_error_mass, 0.05 * declared_mass)
    rates[POSITION] = v  # (6.3)
    if n == DECLARED:
        rates[VELOCITY] = (on_rod + on_table) / mass  # (6.4)
        return rates[VELOCITY]

    if p.specimen_resonance_mass > 0.0:
        on_table += spring_force(p, p.specimen_resonance_mass, y[SPECIMEN], y[SPECIMEN_RATE])
        mass = max(mass - p.specimen_resonance_mass, 0.02 * mass)
    if p.frame_storeys > 0.0:
        on_table += foot_force(p, y)
    return extended_rates(p, y, q_s, on_rod, on_table, mass, split, piston_velocity, rates)


@kernel
def valve_load(p, y, force, n, rates):
    """Pressures of the chambers [Pa] and their rates [Pa/s], as the flow force of the detailed valve takes them.

    rates : work, shape (≥ n,). Rates of zero where no flow force acts.
    """
    p_a, p_b = chamber_pressure(p, y[PRESSURE_A]), chamber_pressure(p, y[PRESSURE_B])
    if not acts(p):
        return p_a, p_b, 0.0, 0.0
    table_rates(p, y, y, force, n, rates)
    return p_a, p_b, rates[PRESSURE_A], rates[PRESSURE_B]


@inlined_kernel
def extended_rates(p, y, q_s, on_rod, on_table, mass, split, piston_velocity, rates):
    """Rates of the velocity and of the states that only effects have; returns the absolute acceleration [m/s²]."""
    for i in range(DECLARED, EXTENDED):
        rates[i] = 0.0
    if split:
        m_r = min(p.coupling_backlash_rod_mass, 0.5 * mass)
        contact = contact_force(p, m_r, y[ROD], y[ROD_RATE])
        acceleration = (contact + on_table) / (mass - m_r)
        rates[ROD] = y[ROD_RATE]
        rates[ROD_RATE] = (on_rod - contact) / m_r - acceleration
    else:
        acceleration = (on_rod + on_table) / mass
    if p.base_flexibility_compliance > 0.0:
        rates[BASE] = y[BASE_RATE]
        rates[BASE_RATE] = base_acceleration(p, y[BASE], y[BASE_RATE], on_rod)
    rates[VELOCITY] = acceleration - rates[BASE_RATE]
    if p.specimen_resonance_mass > 0.0:
        rates[SPECIMEN] = y[SPECIMEN_RATE]
        rates[SPECIMEN_RATE] = -acceleration - spring_force(p, 1.0, y[SPECIMEN], y[SPECIMEN_RATE])
    if p.supply_droop_resistance != 0.0:
        rates[PRESSURE_SUPPLY] = pressure_rate(p, y[PRESSURE_SUPPLY], q_s)
    if p.film_friction_relief != 0.0:
        rates[FILM] = film_rate(p, y[FILM], piston_velocity)
    if p.frame_storeys > 0.0:
        storey_rates(p, y, acceleration, rates)
    rates[FRICTION_MEMORY] = memory_rate(p, piston_velocity, y[FRICTION_MEMORY])
    tau_a, tau_x = p.accelerometer_lag_time_constant, p.position_sensor_lag_time_constant
    if tau_a > 0.0:
        rates[LAGGED_ACCELERATION] = (acceleration - y[LAGGED_ACCELERATION]) / max(tau_a, SHORTEST_LAG)
    if tau_x > 0.0:
        rates[LAGGED_POSITION] = (y[POSITION] - y[LAGGED_POSITION]) / max(tau_x, SHORTEST_LAG)
    return acceleration
