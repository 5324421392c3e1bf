"""Detailed two-stage servo-valve: torque motor, flapper between two nozzles, spool with feedback spring,
(3.1)–(3.16).

State (current i_ca [A], flapper x_f [m], ẋ_f, nozzle pressures P_n1, P_n2, outlet P_n3 [Pa], spool x_s [m], ẋ_s).
Directions: u > 0 drives the flapper to x_f > 0, away from nozzle 1; P_n1 falls, P_n2 rises and pushes the spool to
x_s > 0, which bends the feedback spring against the torque. With these directions the valve is stable, and the
spool's motion shrinks chamber 1: V/E Ṗ_n1 = Q_O1 − Q_n1 + A_s ẋ_s, V/E Ṗ_n2 = Q_O2 − Q_n2 − A_s ẋ_s.

Where the print is wrong: (3.6), (3.7), (3.11) put √2 P/ρ for √(2P/ρ), and the second nozzle's gap is x_f0 − x_f;
(3.12) has + A_s ẋ_s in both chambers; (3.13) lacks a dot; the spring's force on the spool is T_fbs/(l_f + l_fbs),
the arm of (3.14), not l_f − l_fbs; (3.15) outside the clearance the ball has x_s ∓ c_b on the right and left,
printed the other way round.

The flapper rests on a nozzle at |x_f| = x_f0 (a stiff stop), the spool stops at ±x_s,max. Coulomb friction of the
spool takes momentum out of each step, at most all of it, so that the spool truly sticks; ball clearance, friction,
dither, coil inductance and electrical feedback (3.16) are absent at zero.
A classical Runge–Kutta step resolves the valve's fastest pole (some 3e4 1/s, nozzle chambers against the
spool's mass).

Source: thesis (3.1)–(3.16); numbers after Merritt, Hydraulic Control Systems, chapter 7. Verified against the
same equations written a second time, the steady state, and the second-order model of simplified.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.physics.valve.ports import acts, flow_force, sroot
from shake_ros.quantities import Parameters, quantity

CURRENT, FLAPPER, FLAPPER_RATE, NOZZLE_1, NOZZLE_2, OUTLET, SPOOL, SPOOL_RATE = range(8)
DETAILED = 1
VALVE_STATES = 8
MAGNETIC_CONSTANT = 4e-7 * math.pi  # [N/A²]
SUBSTEP = 2e-5  # [s] largest Runge–Kutta step
STOP_RATIO = 30.0  # stiffness of the flapper on a nozzle, in flexure stiffnesses


@dataclass(frozen=True)
class DetailedValve(Parameters):
    """Parameters of (3.1)–(3.16) and of the ports (3.17), (3.18)."""

    code: ClassVar[int] = DETAILED

    amplifier_gain: float = quantity("A", "coil current at full command K_ca", low=1e-4, high=10.0)
    coil_time: float = quantity("s", "time constant L/R of the coil (3.1), 0 for none", low=0.0, high=0.1)
    magnetomotive_force: float = quantity("A", "magnetomotive force M_0 of the permanent magnets", low=1.0, high=1e5)
    turns: float = quantity("-", "number of coil windings N", low=1.0, high=1e6)
    air_gap: float = quantity("m", "air gap g at neutral armature", low=1e-5, high=1e-2)
    air_gap_area: float = quantity("m^2", "area A_g of an air gap", low=1e-7, high=1e-2)
    armature_length: float = quantity("m", "length l_a of the armature", low=1e-4, high=1.0)
    armature_inertia: float = quantity("kg*m^2", "inertia J_a of armature and flapper", low=1e-10, high=1e-2)
    flapper_length: float = quantity("m", "length l_f of the flapper to the nozzles", low=1e-4, high=1.0)
    flapper_damping: float = quantity("N*s", "damping torque B_a per flapper velocity", low=0.0, high=1e3)
    flexure_stiffness: float = quantity("N", "torque K_a of the flexure tube per flapper deflection", low=1.0, high=1e7)
    nozzle_diameter: float = quantity("m", "nozzle diameter D_n", low=1e-5, high=1e-2)
    nozzle_gap: float = quantity("m", "flapper-nozzle distance x_f0 at neutral", low=1e-6, high=1e-3)
    inlet_area: float = quantity("m^2", "area A_0 of an inlet restriction", low=1e-10, high=1e-4)
    outlet_area: float = quantity("m^2", "area A_n3 of the outlet restriction", low=1e-10, high=1e-3)
    outlet_volume: float = quantity("m^3", "volume V_n3 between nozzles and outlet", low=1e-10, high=1e-4)
    chamber_volume: float = quantity("m^3", "volume V_n of a nozzle chamber", low=1e-10, high=1e-4)
    discharge: float = quantity("-", "discharge coefficient C_d", low=0.1, high=1.0)
    density: float = quantity("kg/m^3", "density ρ of the oil", low=500.0, high=2000.0)
    modulus: float = quantity("Pa", "bulk modulus E of the oil in the valve", low=1e7, high=1e10)
    spool_area: float = quantity("m^2", "end area A_s of the spool", low=1e-7, high=1e-2)
    spool_mass: float = quantity("kg", "mass M_s of the spool", low=1e-4, high=10.0)
    spool_damping: float = quantity("N*s/m", "viscous friction w_s of the spool", low=0.0, high=1e4)
    spool_stroke: float = quantity("m", "largest spool displacement x_s,max", low=1e-5, high=1e-1)
    flow_force_stiffness: float = quantity("N/m", "spring in place of the flow force F_ax", low=0.0, high=1e7)
    feedback_stiffness: float = quantity("N", "torque of the feedback spring per deflection K_fbs", low=0.0, high=1e6)
    feedback_length: float = quantity("m", "length l_fbs of the feedback spring", low=1e-4, high=1.0)
    electrical_gain: float = quantity("-", "electrical spool feedback K_sp, 0 for mechanical", low=0.0, high=100.0)
    ball_clearance: float = quantity("m", "clearance c_b of the feedback spring's ball", low=0.0, high=1e-3)
    spool_friction: float = quantity("N", "Coulomb friction F_cs of the spool", low=0.0, high=1e3)
    dither_amplitude: float = quantity("-", "dither on the command", low=0.0, high=0.5)
    dither_frequency: float = quantity("Hz", "frequency of the dither", low=1.0, high=5000.0)
    flow_coefficient: float = quantity(
        "m^3/(s*sqrt(Pa))", "flow coefficient C_v of (3.17)", low=1e-9, high=1e-4, live=True
    )
    underlap: float = quantity("-", "port underlap d_s, negative for overlap", low=-0.5, high=0.5)
    laminar_pressure: float = quantity("Pa", "pressure drop of the laminar-turbulent transition", low=1.0, high=1e6)
    radial_clearance: float = quantity(
        "-", "radial clearance c_rs of the spool, per stroke", low=0.0, high=0.1, default=0.0
    )
    jet_cosine: float = quantity(
        "-", "cosine of the jets' angle to the spool, 0 for no steady flow force", low=0.0, high=1.0, default=0.0
    )
    damping_length_a: float = quantity(
        "m", "damping length L_A of port A's oil along the spool, positive if it damps", low=-0.1, high=0.1, default=0.0
    )
    damping_length_b: float = quantity(
        "m", "damping length L_B of port B's oil along the spool, positive if it damps", low=-0.1, high=0.1, default=0.0
    )


@njit
def coil_current(p, u, spool):
    """Current that the amplifier asks for (3.2), (3.16) [A]."""
    return p.valve_amplifier_gain * (u - p.valve_electrical_gain * spool / p.valve_spool_stroke)


@njit
def motor_torque(p, current, flapper):
    """Torque of the motor (3.3), (3.4) [N·m]."""
    x_g = p.valve_armature_length / p.valve_flapper_length * flapper
    ampere_turns = current * p.valve_turns
    near = (p.valve_magnetomotive_force + ampere_turns) / (p.valve_air_gap - x_g)
    far = (p.valve_magnetomotive_force - ampere_turns) / (p.valve_air_gap + x_g)
    scale = 0.25 * MAGNETIC_CONSTANT * p.valve_air_gap_area * p.valve_armature_length
    return scale * (near * near - far * far)


@njit
def feedback_torque(p, flapper, spool):
    """Torque of the feedback spring with the ball's clearance (3.14), (3.15) [N·m]."""
    bent = (p.valve_flapper_length + p.valve_feedback_length) / p.valve_flapper_length * flapper + spool
    c_b = p.valve_ball_clearance
    if c_b > 0.0:
        bent = bent - c_b if bent > c_b else (bent + c_b if bent < -c_b else 0.0)
    return p.valve_feedback_stiffness * bent


@njit
def restriction_flow(p, area, drop):
    """Turbulent flow through a restriction of the pilot stage (3.6), (3.7), (3.11) [m³/s]."""
    return p.valve_discharge * area * math.sqrt(2.0 / p.valve_density) * sroot(drop, 1e-3 * p.valve_laminar_pressure)


@njit
def flow_torque(p, flapper, p_n1, p_n2, p_n3):
    """Torque of the flow forces on the flapper (3.8)–(3.10) [N·m]."""
    d_n = p.valve_nozzle_diameter
    scale = 4.0 * p.valve_discharge / d_n
    gap_1 = max(p.valve_nozzle_gap + flapper, 0.0) * scale
    gap_2 = max(p.valve_nozzle_gap - flapper, 0.0) * scale
    area = 0.25 * math.pi * d_n * d_n
    force = area * ((1.0 + gap_1 * gap_1) * (p_n1 - p_n3) - (1.0 + gap_2 * gap_2) * (p_n2 - p_n3))
    return p.valve_flapper_length * force


@njit
def stop_torque(p, flapper, flapper_rate):
    """Torque by which a nozzle holds the flapper back [N·m]."""
    over = abs(flapper) - p.valve_nozzle_gap
    if over <= 0.0:
        return 0.0
    stiffness = STOP_RATIO * p.valve_flexure_stiffness
    outward = flapper_rate if flapper > 0.0 else -flapper_rate
    push = max(stiffness * over + p.valve_flapper_damping * outward, 0.0)
    return -push if flapper > 0.0 else push


@njit
def valve_rates(p, y, u, p_s, p_t, load, rates):
    """Rates of the eight states under command u [-], supply and tank pressure [Pa], into `rates`.

    load : P_A, P_B [Pa] and their rates [Pa/s], for the flow force alone.

    Coulomb friction of the spool is not among them: `valve_step` applies it to the speed, where it can also hold.
    """
    x_f, v_f, x_s, v_s = y[FLAPPER], y[FLAPPER_RATE], y[SPOOL], y[SPOOL_RATE]
    p_n1, p_n2, p_n3 = y[NOZZLE_1], y[NOZZLE_2], y[OUTLET]
    wanted = coil_current(p, u, x_s)
    if p.valve_coil_time > 0.0:
        current = y[CURRENT]
        rates[CURRENT] = (wanted - current) / p.valve_coil_time  # (3.1)
    else:
        current = wanted
        rates[CURRENT] = 0.0
    spring = feedback_torque(p, x_f, x_s)
    torque = motor_torque(p, current, x_f) + flow_torque(p, x_f, p_n1, p_n2, p_n3) + stop_torque(p, x_f, v_f) - spring
    resisting = p.valve_flapper_damping * v_f + p.valve_flexure_stiffness * x_f
    rates[FLAPPER] = v_f
    rates[FLAPPER_RATE] = p.valve_flapper_length / p.valve_armature_inertia * (torque - resisting)  # (3.5)

    curtain = math.pi * p.valve_nozzle_diameter
    q_n1 = restriction_flow(p, curtain * max(p.valve_nozzle_gap + x_f, 0.0), p_n1 - p_n3)  # (3.6)
    q_n2 = restriction_flow(p, curtain * max(p.valve_nozzle_gap - x_f, 0.0), p_n2 - p_n3)
    q_out = restriction_flow(p, p.valve_outlet_area, p_n3 - p_t)
    q_o1 = restriction_flow(p, p.valve_inlet_area, p_s - p_n1)  # (3.11)
    q_o2 = restriction_flow(p, p.valve_inlet_area, p_s - p_n2)
    swept = p.valve_spool_area * v_s
    stiffness = p.valve_modulus / p.valve_chamber_volume
    rates[NOZZLE_1] = stiffness * (q_o1 - q_n1 + swept)  # (3.12)
    rates[NOZZLE_2] = stiffness * (q_o2 - q_n2 - swept)
    rates[OUTLET] = p.valve_modulus / p.valve_outlet_volume * (q_n1 + q_n2 - q_out)  # (3.7)

    force = p.valve_spool_area * (p_n2 - p_n1) - p.valve_spool_damping * v_s - p.valve_flow_force_stiffness * x_s
    force -= spring / (p.valve_flapper_length + p.valve_feedback_length)
    if acts(p):
        stroke = p.valve_spool_stroke
        force -= flow_force(p, x_s / stroke, v_s / stroke, load, p_s, p_t)
    rates[SPOOL] = v_s
    rates[SPOOL_RATE] = force / p.valve_spool_mass  # (3.13)


@njit
def valve_step(p, y, u, p_s, p_t, load, h, k, stage):
    """One classical Runge–Kutta step of size h in place; the spool stops at its ends. k (4, 8), stage (8,): work."""
    valve_rates(p, y, u, p_s, p_t, load, k[0])
    for j in range(1, 4):
        part = h if j == 3 else 0.5 * h
        for i in range(VALVE_STATES):
            stage[i] = y[i] + part * k[j - 1, i]
        valve_rates(p, stage, u, p_s, p_t, load, k[j])
    for i in range(VALVE_STATES):
        y[i] += h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
    if p.valve_spool_friction > 0.0:  # F_cs of (3.13): takes away speed, at most all of it
        most = h * p.valve_spool_friction / p.valve_spool_mass
        lost = min(max(y[SPOOL_RATE], -most), most)
        y[SPOOL_RATE] -= lost
        y[SPOOL] -= 0.5 * h * lost
    if abs(y[SPOOL]) > p.valve_spool_stroke:
        y[SPOOL] = min(max(y[SPOOL], -p.valve_spool_stroke), p.valve_spool_stroke)
        y[SPOOL_RATE] = 0.0


@njit
def carry_valve(p, y, u, p_s, p_t, load, time, duration, k, stage):
    """The valve carried in place over `duration` under a held command and the dither, from the instant `time` [s].

    load : as in `valve_rates` at the start; the pressures go on evenly.
    """
    steps = max(1, math.ceil(duration / SUBSTEP - 1e-9))
    h = duration / steps
    omega = 2.0 * math.pi * p.valve_dither_frequency
    for i in range(steps):
        dither = p.valve_dither_amplitude * math.sin(omega * (time + (i + 0.5) * h))
        middle = (i + 0.5) * h
        now = load[0] + middle * load[2], load[1] + middle * load[3], load[2], load[3]
        valve_step(p, y, u + dither, p_s, p_t, now, h, k, stage)


@njit
def valve_at_rest(p, p_s, p_t):
    """State of the valve at null under pressure: nozzle pressures in balance, the rest zero, shape (8,).

    With r_1 = inlet to nozzle and r_2 = nozzle to outlet area ratios the three drops share P_s − P_T as 1, r_1², (2
    r_1 r_2)².
    """
    nozzle = math.pi * p.valve_nozzle_diameter * p.valve_nozzle_gap
    weights = (1.0 / p.valve_inlet_area**2, 1.0 / nozzle**2, (2.0 / p.valve_outlet_area) ** 2)
    drop = (p_s - p_t) / (weights[0] + weights[1] + weights[2])
    y = np.zeros(VALVE_STATES)
    y[NOZZLE_1] = y[NOZZLE_2] = p_s - weights[0] * drop
    y[OUTLET] = p_t + weights[2] * drop
    return y
