"""Integration of the table: embedded Runge–Kutta 5(4) of Dormand and Prince with error control, one sample at a time.

Between two sampling instants the command is held (zero-order hold); within a sample the step adapts to the
tolerance and never crosses the sample's end or the instant at which a delayed command arrives. The equation is
non-stiff by construction (the play is exact, the pre-sliding law is a function of displacement, sroot is laminar near
zero), so an explicit method of high order is the fastest that holds 0.1 %. Verified against Radau at rtol 1e-9.
"""

from __future__ import annotations

import math

import numpy as np

from shake_ros.core.compiled import njit
from shake_ros.core.effects.presliding_friction import deflection
from shake_ros.core.friction.armstrong import CODE as ARMSTRONG
from shake_ros.core.friction.armstrong import dwelt
from shake_ros.core.friction.selected import is_dynamic
from shake_ros.core.plant.right_hand_side import active_states, chamber_pressure, contact_end, right_hand_side
from shake_ros.core.plant.shear_frame import LARGEST_STOREYS
from shake_ros.core.plant.states import (
    BRISTLE,
    CLOCK,
    CONTINUOUS,
    DECLARED,
    DEFLECTION,
    DWELL,
    FRICTION_AT_STOP,
    FRICTION_MEMORY,
    FRICTION_RISE,
    HELD_COMMAND,
    LAGGED_ACCELERATION,
    LAGGED_POSITION,
    POSITION,
    PRESSURE_A,
    PRESSURE_B,
    PRESSURE_SUPPLY,
    ROD,
    ROD_RATE,
    SPOOL,
    SPOOL_RATE,
    STEP_SIZE,
    VALVE,
    VALVE_TIME,
    VELOCITY,
)
from shake_ros.core.valve.detailed import CODE as DETAILED
from shake_ros.core.valve.detailed import SPOOL as VALVE_SPOOL
from shake_ros.core.valve.detailed import VALVE_STATES, carry_valve
from shake_ros.core.valve.simplified import play

STAGES = 7
VALVE_PART = 1e-4  # [s] largest interval over which the table takes the detailed valve's spool as moving evenly
SMALLEST_STEP = 1e-7  # [s] below it the step is taken whatever its error, so that nothing can hang
# Error scale of each continuous state: absolute part in its unit, at tolerance 1.
# The spool's speed is given twenty times the room of the rest: it acts only through the spool's position.
ABSOLUTE = np.array(
    [1e-2, 0.2, 1e6, 1e6, 0.2, 4000.0]  # declared
    + [1e6, 1.0, 1e-2, 0.2, 1e-3, 0.2, 1e-2, 0.2, 5.0, 1e-2, 0.1]  # effects, friction memory
    + [1e-4, 1e-4, 1e6, 1e6]  # pipelines
    + LARGEST_STOREYS * [1e-2, 0.2]
)
OUTPUTS = 7  # columns of `simulate`: position, velocity, acceleration, P_A, P_B, P_s, spool


@njit
def _stage(p, y, k, weights, count, h, wanted, force, n, stage, out):
    """State y + h Σ weights·k over `count` stages into `stage`, its rates into `out`; returns the acceleration."""
    for i in range(n):
        s = 0.0
        for j in range(count):
            s += weights[j] * k[j, i]
        stage[i] = y[i] + h * s
    return right_hand_side(p, stage, y, wanted, force, n, out)


A2 = (1.0 / 5.0,)
A3 = (3.0 / 40.0, 9.0 / 40.0)
A4 = (44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0)
A5 = (19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0)
A6 = (9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0)
A7 = (35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0)
E1, E3, E4 = 71.0 / 57600.0, -71.0 / 16695.0, 71.0 / 1920.0  # fifth minus fourth order
E5, E6, E7 = -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0


@njit
def dormand_prince(p, y, k, h, wanted, force, n, stage, absolute, tolerance):
    """One trial step of size h from y with first-stage rates k[0]; result in `stage`, its rates in k[6].

    Returns
    -------
    (error relative to the tolerance [-], acceleration at the end [m/s²])
    """
    _stage(p, y, k, A2, 1, h, wanted, force, n, stage, k[1])
    _stage(p, y, k, A3, 2, h, wanted, force, n, stage, k[2])
    _stage(p, y, k, A4, 3, h, wanted, force, n, stage, k[3])
    _stage(p, y, k, A5, 4, h, wanted, force, n, stage, k[4])
    _stage(p, y, k, A6, 5, h, wanted, force, n, stage, k[5])
    acceleration = _stage(p, y, k, A7, 6, h, wanted, force, n, stage, k[6])
    worst = 0.0
    for i in range(n):
        slip = E1 * k[0, i] + E3 * k[2, i] + E4 * k[3, i] + E5 * k[4, i] + E6 * k[5, i] + E7 * k[6, i]
        error = abs(h * slip) / (absolute[i] + abs(y[i]))
        if not error <= worst:  # also true for NaN
            worst = error
            if not math.isfinite(error):
                break  # a later state must not hide it
    return worst / tolerance, acceleration


@njit
def spool_command(p, y, u):
    """Wanted spool position: gain and null shift, then the play of the hysteresis (3.19); updates the held command."""
    gain = 1.0 if p.valve_kind == DETAILED else p.valve_gain
    wanted = gain * (u + p.valve_null_shift_offset)
    wanted = min(max(wanted, -1.0), 1.0)
    y[HELD_COMMAND] = play(y[HELD_COMMAND], wanted, p.valve_hysteresis + p.spool_hysteresis_width)
    return y[HELD_COMMAND]


@njit
def settle_contact(p, y, end, duration, n):
    """Contact states of the friction at the end of an accepted step, in place; `y` still is the step's start."""
    if p.presliding_friction_distance > 0.0 or is_dynamic(p):
        moved = end[POSITION] - y[POSITION]
        v_0, v_1 = y[VELOCITY], end[VELOCITY]
        if n > DECLARED:
            moved += end[ROD] - y[ROD]
            v_0 += y[ROD_RATE]
            v_1 += end[ROD_RATE]
        if p.presliding_friction_distance > 0.0:
            y[BRISTLE] = deflection(y[BRISTLE], moved, p.presliding_friction_distance)
        if is_dynamic(p):
            memory = end[FRICTION_MEMORY] if n > DECLARED else 0.0
            y[DEFLECTION] = contact_end(p, y, moved, v_0, v_1, memory)
            if p.friction_kind == ARMSTRONG:
                y[DWELL], y[FRICTION_AT_STOP], y[FRICTION_RISE] = dwelt(
                    p, y[DEFLECTION], memory, duration, y[DWELL], y[FRICTION_AT_STOP], y[FRICTION_RISE]
                )


@njit
def integrate(p, y, wanted, force, duration, n, k, stage, absolute, tolerance):
    """Integrate y in place over `duration`, `wanted` as in `right_hand_side`; returns the last acceleration [m/s²]."""
    if not math.isfinite(y[VELOCITY]):
        return math.nan  # a lost run ends here at once instead of in the smallest of steps
    h = max(y[STEP_SIZE], SMALLEST_STEP)
    done = 0.0
    acceleration = right_hand_side(p, y, y, wanted, force, n, k[0])
    while done < duration:
        rest = duration - done
        last = h >= rest * 0.999
        step = rest if last else h
        error, a_end = dormand_prince(p, y, k, step, wanted, force, n, stage, absolute, tolerance)
        if not error <= 1.0 and step > SMALLEST_STEP:
            shrink = 0.9 * error**-0.2 if error < 1e9 else 0.1
            h = step * max(shrink, 0.1)
            continue
        settle_contact(p, y, stage, step, n)
        for i in range(n):
            y[i] = stage[i]
            k[0, i] = k[STAGES - 1, i]
        if abs(y[SPOOL]) > 1.0:
            y[SPOOL] = min(max(y[SPOOL], -1.0), 1.0)
            y[SPOOL_RATE] = 0.0
            right_hand_side(p, y, y, wanted, force, n, k[0])
        acceleration = a_end
        if not math.isfinite(error):
            y[VELOCITY] = math.nan
            return math.nan
        done = duration if last else done + step
        grow = 0.9 * error**-0.2 if error > 1e-6 else 5.0
        proposed = step * min(max(grow, 0.2), 5.0)
        h = max(proposed, h) if last and step < h else proposed
    y[STEP_SIZE] = h
    return acceleration


@njit
def hold_detailed(p, y, u, force, duration, n, k, stage, absolute, tolerance):
    """`hold` with the detailed valve: the valve by its own fixed steps, the table along the spool's chords.

    The table does not act back on the pilot stage, so the valve goes ahead over each part of at most VALVE_PART and the
    table follows with the spool moving evenly between its two ends: the chord of a 150 Hz motion is off by 0.1 %.
    """
    wanted = spool_command(p, y, u)
    parts = max(1, math.ceil(duration / VALVE_PART - 1e-9))
    part = duration / parts
    valve = y[VALVE : VALVE + VALVE_STATES]
    valve_k, valve_stage = np.zeros((4, VALVE_STATES)), np.zeros(VALVE_STATES)
    p_t = p.supply_tank_pressure + p.tank_back_pressure_pressure
    acceleration = 0.0
    for _ in range(parts):
        p_s = y[PRESSURE_SUPPLY] if p.supply_droop_resistance != 0.0 else p.supply_supply_pressure
        before = valve[VALVE_SPOOL] / p.valve_spool_stroke
        carry_valve(p, valve, wanted, p_s, p_t, y[VALVE_TIME], part, valve_k, valve_stage)
        y[VALVE_TIME] = (y[VALVE_TIME] + part) % (1.0 / p.valve_dither_frequency)
        y[SPOOL] = before
        y[SPOOL_RATE] = (valve[VALVE_SPOOL] / p.valve_spool_stroke - before) / part
        acceleration = integrate(p, y, y[SPOOL_RATE], force, part, n, k, stage, absolute, tolerance)
    return acceleration


@njit
def hold(p, y, u, force, duration, n, k, stage, absolute, tolerance):
    """Integrate y in place over `duration` under a held command; returns the acceleration at its end [m/s²]."""
    if p.valve_kind == DETAILED:
        return hold_detailed(p, y, u, force, duration, n, k, stage, absolute, tolerance)
    wanted = spool_command(p, y, u)
    return integrate(p, y, wanted, force, duration, n, k, stage, absolute, tolerance)


@njit
def accelerometer(p, y, acceleration):
    """What the accelerometer's output is before noise: lag, scale, bias [m/s²]."""
    a = y[LAGGED_ACCELERATION] if p.accelerometer_lag_time_constant > 0.0 else acceleration
    return (1.0 + p.accelerometer_scale_error) * a + p.accelerometer_bias_bias


@njit
def position_sensor(p, y):
    """What the position transducer's output is before noise [m]."""
    return y[LAGGED_POSITION] if p.position_sensor_lag_time_constant > 0.0 else y[POSITION]


@njit
def delayed(commands, k, delay_samples):
    """Commands that act at the start and at the end of sample k, and the fraction of the sample for the first.

    A command u_k stamped t_k acts from t_k + T; before the first command arrives the first one is taken as standing.
    """
    whole = math.floor(delay_samples)
    fraction = delay_samples - whole
    late = commands[max(k - whole - 1, 0)]
    timely = commands[max(k - whole, 0)]
    return late, timely, fraction


@njit
def advance_sample(p, y, late, timely, fraction, force, dt, k, stage, absolute, tolerance):
    """Integrate one sample in place: `late` acts for its first `fraction`, `timely` for the rest."""
    n = active_states(p)
    acceleration = 0.0
    if fraction > 1e-9:
        acceleration = hold(p, y, late, force, fraction * dt, n, k, stage, absolute, tolerance)
    if fraction < 1.0:
        acceleration = hold(p, y, timely, force, (1.0 - fraction) * dt, n, k, stage, absolute, tolerance)
    y[CLOCK] += dt
    return acceleration


@njit
def sensed_velocity(p, y):
    """Rate of what the position transducer shows [m/s]."""
    tau = p.position_sensor_lag_time_constant
    return (y[POSITION] - y[LAGGED_POSITION]) / tau if tau > 0.0 else y[VELOCITY]


@njit
def outputs(p, y, acceleration, row):
    """Measured channels and inner states of one instant into `row`, shape (OUTPUTS,)."""
    row[0] = position_sensor(p, y)
    row[1] = sensed_velocity(p, y)
    row[2] = accelerometer(p, y, acceleration)
    row[3] = chamber_pressure(p, y[PRESSURE_A])
    row[4] = chamber_pressure(p, y[PRESSURE_B])
    row[5] = y[PRESSURE_SUPPLY] if p.supply_droop_resistance != 0.0 else p.supply_supply_pressure
    row[6] = y[SPOOL]


@njit
def acceleration_now(p, y, rates):
    """Absolute acceleration of the table at state y without external force [m/s²]."""
    return right_hand_side(p, y, y, y[HELD_COMMAND], 0.0, active_states(p), rates)


@njit
def simulate(p, commands, forces, track, y0, dt, tolerance, out):
    """Free-running simulation under recorded commands.

    Parameters
    ----------
    p : parameter record. commands : shape (n,) [-]. forces : external force, shape (n,) or (0,) [N].
    track : measured position, shape (n,) or (0,) [m]: where given, the position is set to it at every sample, so that
        volumes and position-dependent effects see the true place though a free run would drift off the stroke.
    y0 : state at the first sample, shape (STATES,). dt : [s]. tolerance : relative local error of a step.
    out : result, shape (n, OUTPUTS), row k is the instant t_k, before command k acts.
    """
    y = y0.copy()
    k = np.zeros((STAGES, CONTINUOUS))
    stage = np.zeros(CONTINUOUS)
    absolute = ABSOLUTE.copy()
    delay = p.command_delay_delay / dt
    following = track.shape[0] > 0
    acceleration = acceleration_now(p, y, stage)
    for i in range(commands.shape[0]):
        if following:
            shift = track[i] - y[POSITION]
            y[POSITION] = track[i]
            y[LAGGED_POSITION] += shift
        outputs(p, y, acceleration, out[i])
        force = forces[i] if forces.shape[0] > 0 else 0.0
        late, timely, fraction = delayed(commands, i, delay)
        acceleration = advance_sample(p, y, late, timely, fraction, force, dt, k, stage, absolute, tolerance)
