"""The detailed valve (3.1)–(3.16) written a second time, from the equation sheet alone, and a step to try it with."""

from __future__ import annotations

import math

import numpy as np

SUPPLY, TANK = 206e5, 1e5  # [Pa]


def step(size, samples=300):
    """Null for ten samples, then a held command [-]."""
    return np.where(np.arange(samples) < 10, 0.0, size)


def rates_of_the_sheet(v, y, u, p_s, p_t):
    """(3.1)–(3.16) once more, from the equation sheet: the rates of all eight states within the stops."""
    i, x_f, v_f, p_1, p_2, p_3, x_s, v_s = y
    wanted = v.amplifier_gain * (u - v.electrical_gain * x_s / v.spool_stroke)
    i = i if v.coil_time else wanted
    x_g = x_f * v.armature_length / v.flapper_length
    flux = (
        ((v.magnetomotive_force + i * v.turns) / (v.air_gap - x_g)) ** 2,
        ((v.magnetomotive_force - i * v.turns) / (v.air_gap + x_g)) ** 2,
    )
    motor = 4e-7 * math.pi * v.air_gap_area * v.armature_length / 4.0 * (flux[0] - flux[1])
    ratio = [1.0 + (4.0 * v.discharge * (v.nozzle_gap + way * x_f) / v.nozzle_diameter) ** 2 for way in (1.0, -1.0)]
    nozzle = math.pi / 4.0 * v.nozzle_diameter**2
    jets = v.flapper_length * nozzle * (ratio[0] * (p_1 - p_3) - ratio[1] * (p_2 - p_3))
    ball = x_f * (1.0 + v.feedback_length / v.flapper_length) + x_s
    ball = math.copysign(max(abs(ball) - v.ball_clearance, 0.0), ball)
    spring = v.feedback_stiffness * ball
    torque = motor + jets - spring - v.flapper_damping * v_f - v.flexure_stiffness * x_f

    def through(area, drop):
        return v.discharge * area * math.sqrt(2.0 * drop / v.density)

    curtain = [math.pi * v.nozzle_diameter * (v.nozzle_gap + way * x_f) for way in (1.0, -1.0)]
    out_1, out_2 = through(curtain[0], p_1 - p_3), through(curtain[1], p_2 - p_3)
    in_1, in_2 = through(v.inlet_area, p_s - p_1), through(v.inlet_area, p_s - p_2)
    spool = v.spool_area * (p_2 - p_1) - v.spool_damping * v_s - v.flow_force_stiffness * x_s
    spool -= spring / (v.flapper_length + v.feedback_length)
    return [
        (wanted - i) / v.coil_time if v.coil_time else 0.0,
        v_f,
        torque * v.flapper_length / v.armature_inertia,
        v.modulus / v.chamber_volume * (in_1 - out_1 + v.spool_area * v_s),
        v.modulus / v.chamber_volume * (in_2 - out_2 - v.spool_area * v_s),
        v.modulus / v.outlet_volume * (out_1 + out_2 - through(v.outlet_area, p_3 - p_t)),
        v_s,
        spool / v.spool_mass,
    ]
