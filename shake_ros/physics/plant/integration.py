"""Integration of the table with error control, one sample at a time, by the steps of dormand_prince.py.

Between two sampling instants the command is held (zero-order hold); within a sample the step adapts to the
tolerance and never crosses the sample's end or the instant at which a delayed command arrives. The equation is
non-stiff by construction (spool and backlash are exact, the pre-sliding law is a function of displacement, sroot is
laminar near zero), so an explicit method of high order is the fastest that holds 0.1 %: one step a sample as a rule,
and because a new command does not change the rates of the table, the last stage of a sample is the first of the next.
Verified against Radau at rtol 1e-9.

A run can follow the steps of another: what differs between the runs is then what differs between the tables.

An integrator with error control takes other steps for another table, and the local errors change with them by about the
tolerance: a difference of two runs shows that beside the parameter's change, unless the tolerance is far below what
the runs themselves need. Runs that follow the instants at which the steps of a first one ended differ smoothly. A run
whose own error is too large for them goes on with its own steps until the sample ends.

Source: the internal differentiation of H. G. Bock, Numerical treatment of inverse problems in chemical reaction
kinetics, in: Modelling of Chemical Reaction Systems (1981), 102.
"""

from __future__ import annotations

import math

import numpy as np

from shake_ros.compiled import kernel, njit
from shake_ros.physics.effects.friction import deflection
from shake_ros.physics.friction import is_dynamic
from shake_ros.physics.friction.armstrong import ARMSTRONG, dwelt
from shake_ros.physics.plant.dormand_prince import (
    FILTER,
    PACE,
    PATH,
    STAGE,
    STAGES,
    dormand_prince,
    spool_path,
    workspace,
)
from shake_ros.physics.plant.options import chamber_pressure
from shake_ros.physics.plant.right_hand_side import (
    SHORTEST_LAG,
    active_states,
    contact_end,
    follows_clock,
    right_hand_side,
    table_rates,
    valve_load,
)
from shake_ros.physics.plant.sensors import INPUT, OMEGA, OUTPUT, advance_filter, begin_filter
from shake_ros.physics.plant.states import (
    BASE_RATE,
    BRISTLE,
    CLOCK,
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
from shake_ros.physics.valve.detailed import DETAILED, VALVE_STATES, carry_valve
from shake_ros.physics.valve.detailed import SPOOL as VALVE_SPOOL
from shake_ros.physics.valve.simplified import backlash

# A row of the work array within a sample: what to do, time since its start [s], number of instants, the next, and all
MODE, ELAPSED, COUNT, NEXT, INSTANTS = range(5)
OWN, KEEP, FOLLOW = 0.0, 1.0, 2.0  # own steps; own steps, whose instants are kept; the instants that were kept
MOST = 32  # instants kept of a sample; one with more of them is not followed
FORGIVEN = 8.0  # times the tolerance, up to which a followed step is good enough
SAME = 1e-9  # [s] instants that are no two


@kernel
def begin_sample(row, kept, following):
    """Begin a sample: a run keeps its instants into `kept`, shape (1 + MOST,), later, or follows those in it."""
    row[ELAPSED] = row[COUNT] = row[NEXT] = 0.0
    row[MODE] = KEEP
    if following:
        row[COUNT] = kept[0]
        row[MODE] = FOLLOW if kept[0] <= MOST else OWN
        for i in range(min(int(kept[0]), MOST)):
            row[INSTANTS + i] = kept[1 + i]


@kernel
def end_sample(row, kept):
    """Keep the instants of a sample that has ended."""
    kept[0] = row[COUNT]
    for i in range(min(int(row[COUNT]), MOST)):
        kept[1 + i] = row[INSTANTS + i]


@kernel
def displace(y, distance):
    """Move the table and what its transducer shows by a distance [m], in place."""
    y[POSITION] += distance
    y[LAGGED_POSITION] += distance


@kernel
def followed(row, rest):
    """Length of the next step of a run that follows [s]; `rest` : to the end of the interval."""
    k = int(row[NEXT])
    while k < row[COUNT] and row[INSTANTS + k] <= row[ELAPSED] + SAME:
        k += 1
    row[NEXT] = k
    if k == row[COUNT]:
        return rest
    size = row[INSTANTS + k] - row[ELAPSED]
    return size if size < rest - SAME else rest


@kernel
def stepped(row, step):
    """Count a step that was taken."""
    row[ELAPSED] += step
    if row[MODE] == KEEP:
        if row[COUNT] < MOST:
            row[INSTANTS + int(row[COUNT])] = row[ELAPSED]
        row[COUNT] += 1.0


VALVE_PART = 1e-4  # [s] largest interval over which the table takes the detailed valve's spool as moving evenly
MOST_STEPS = 5000  # of one call: what asks for more would go on for minutes, and counts as a lost run
SMALLEST_STEP = 1e-7  # [s] below it the step is taken whatever its error, so that nothing can hang
LARGEST_GROWTH = 4.0  # of a step
WHOLE = 0.24  # part of the wanted step from which a step's error tells of the next one; shorter ones were cut off
FIRST_RATE, FORGETS = 40.0, 0.5  # of the correction that finds a state [1/s]; part of the time that it remembers
OUTPUTS = 7  # columns of `simulate`: position, velocity, acceleration, P_A, P_B, P_s, spool


@kernel
def spool_command(p, y, u):
    """Wanted spool position: gain and null shift, and with the detailed valve the backlash of the hysteresis.

    The simplified valve has its hysteresis as dry friction on the spool (3.19), see `spool_path`. Keeps the command.
    """
    detailed = p.valve_kind == DETAILED
    wanted = (1.0 if detailed else p.valve_gain) * (u + p.valve_null_shift_offset)
    wanted = min(max(wanted, -1.0), 1.0)
    if detailed:
        wanted = backlash(y[HELD_COMMAND], wanted, p.valve_hysteresis + p.spool_hysteresis_width)
    y[HELD_COMMAND] = wanted
    return wanted


@kernel
def has_contact(p):
    """Whether friction has a state of its own that follows the displacement since the step's start."""
    return p.presliding_friction_distance > 0.0 or is_dynamic(p)


@kernel
def settle_contact(p, y, end, duration, n):
    """Contact states of the friction at the end of an accepted step, in place; `y` still is the step's start."""
    if has_contact(p):
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


@kernel
def felt(p, y, acceleration):
    """The acceleration behind the accelerometer's lag [m/s²]."""
    shown = min(p.accelerometer_lag_time_constant / SHORTEST_LAG, 1.0)
    return acceleration if shown <= 0.0 else acceleration + shown * (y[LAGGED_ACCELERATION] - acceleration)


@kernel
def gathered(p, y):
    """Integral of what the accelerometer shows behind its lag, from any instant [m/s]: of the lag ȧ_l = (a − a_l)/τ."""
    speed, tau = y[VELOCITY] + y[BASE_RATE], p.accelerometer_lag_time_constant
    return speed - min(tau / SHORTEST_LAG, 1.0) * max(tau, SHORTEST_LAG) * y[LAGGED_ACCELERATION]


@kernel
def integrate(p, y, wanted, force, duration, n, work, known, tolerance):
    """Integrate y in place over `duration` in steps of about equal length; returns the last acceleration [m/s²].

    wanted : as in `right_hand_side`. known : whether work[0] holds the rates at y. The size from which the next call
    starts is the smallest that a step here asked for.
    """
    if not math.isfinite(y[VELOCITY]):
        return math.nan  # a lost run ends here at once instead of in the smallest of steps
    known = known and not has_contact(p) and not follows_clock(p)  # the contact has settled, the clock gone on
    acceleration = 0.0 if known else table_rates(p, y, y, force, n, work[0])
    h = max(y[STEP_SIZE], SMALLEST_STEP)
    smallest = math.inf
    filtering = work[FILTER, OMEGA] > 0.0
    if filtering and not known:
        work[FILTER, INPUT] = felt(p, y, acceleration)
    done, last, pace, tried = 0.0, False, work[PACE], 0
    while not last:
        tried += 1
        if tried > MOST_STEPS:
            y[VELOCITY] = math.nan
            return math.nan
        rest, following = duration - done, pace[MODE] == FOLLOW
        size = followed(pace, rest) if following else rest / max(math.ceil(rest / max(h, SMALLEST_STEP) - 1e-3), 1.0)
        step = spool_path(p, y, wanted, size, work[PATH])
        last = size == rest and step == size
        error, a_end = dormand_prince(p, y, work, step, force, n)
        error /= tolerance
        if not error <= (FORGIVEN if following else 1.0) and step > SMALLEST_STEP:
            if following:
                pace[MODE] = OWN
            h = step * max(0.9 * error**-0.2, 0.1)
            smallest = min(smallest, h)
            last = False
            continue
        settle_contact(p, y, work[STAGE], step, n)
        before = gathered(p, y)
        for i in range(n):
            y[i] = work[STAGE, i]
            work[0, i] = work[STAGES - 1, i]
        acceleration = a_end
        if filtering:
            advance_filter(work[FILTER], felt(p, y, a_end), gathered(p, y) - before, step)
        if not math.isfinite(error):
            y[VELOCITY] = math.nan
            return math.nan
        done += step
        stepped(pace, step)
        if not following and (step > WHOLE * h or error > 0.5):
            h = step * min(0.9 * max(error, 1e-6) ** -0.2, LARGEST_GROWTH)
        smallest = min(smallest, h)
    y[STEP_SIZE] = max(smallest, SMALLEST_STEP)
    return acceleration


@njit
def hold_detailed(p, y, u, force, duration, n, work, known, tolerance):
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
        load = valve_load(p, y, force, n, work[0])
        carry_valve(p, valve, wanted, p_s, p_t, load, y[VALVE_TIME], part, valve_k, valve_stage)
        y[VALVE_TIME] = (y[VALVE_TIME] + part) % (1.0 / p.valve_dither_frequency)
        y[SPOOL] = before
        y[SPOOL_RATE] = (valve[VALVE_SPOOL] / p.valve_spool_stroke - before) / part
        acceleration = integrate(p, y, y[SPOOL_RATE], force, part, n, work, known, tolerance)
        known = True
    return acceleration


@kernel
def hold(p, y, u, force, duration, n, work, known, tolerance):
    """Integrate y in place over `duration` under a held command; returns the acceleration at its end [m/s²]."""
    if p.valve_kind == DETAILED:
        return hold_detailed(p, y, u, force, duration, n, work, known, tolerance)
    wanted = spool_command(p, y, u)
    return integrate(p, y, wanted, force, duration, n, work, known, tolerance)


@kernel
def scaled(p, acceleration):
    """With the accelerometer's errors of scale and bias [m/s²]."""
    return (1.0 + p.accelerometer_scale_error) * acceleration + p.accelerometer_bias_bias


@kernel
def accelerometer(p, y, acceleration):
    """What the accelerometer's output is before noise: lag, scale, bias [m/s²]."""
    return scaled(p, felt(p, y, acceleration))


@kernel
def position_sensor(p, y):
    """What the position transducer's output is before noise [m]."""
    shown = min(p.position_sensor_lag_time_constant / SHORTEST_LAG, 1.0)
    return y[POSITION] if shown <= 0.0 else y[POSITION] + shown * (y[LAGGED_POSITION] - y[POSITION])


@kernel
def follow(p, y, measured):
    """Put the table where its transducer shows the measured position [m], in place.

    Volumes and position-dependent effects then see the true place though a free run would drift off the stroke. A slow
    transducer shows where the table was: at 0.3 m/s behind a lag of 90 ms it is 27 mm further on.
    """
    displace(y, measured - position_sensor(p, y))


@kernel
def delayed(commands, k, delay_samples, command_before):
    """Commands that act at the start and at the end of sample k, and the fraction of the sample for the first.

    A command u_k stamped t_k acts from t_k + T; until the first one arrives `command_before` acts.
    """
    whole = math.floor(delay_samples)
    fraction = delay_samples - whole
    late = commands[k - whole - 1] if k > whole else command_before
    timely = commands[k - whole] if k >= whole else command_before
    return late, timely, fraction


@kernel
def advance_sample(p, y, late, timely, fraction, force, dt, work, known, tolerance):
    """Integrate one sample in place: `late` acts for its first `fraction`, `timely` for the rest.

    work : from `workspace`. known : whether work[0] holds the rates at y under this force, as the sample before left
    them there. Returns the acceleration at the sample's end [m/s²].
    """
    n = active_states(p)
    acceleration = 0.0
    if fraction > 1e-9:
        acceleration = hold(p, y, late, force, fraction * dt, n, work, known, tolerance)
        known = True
    if fraction < 1.0:
        acceleration = hold(p, y, timely, force, (1.0 - fraction) * dt, n, work, known, tolerance)
    y[CLOCK] += dt
    return acceleration


@kernel
def advance_late(p, y, past, u, whole, fraction, force, dt, work, known, tolerance):
    """`advance_sample` under a new command u; `past` : commands before, newest first, in which it takes its place.

    whole, fraction : dead time in samples.
    """
    for i in range(past.shape[0] - 1, 0, -1):
        past[i] = past[i - 1]
    past[0] = u
    return advance_sample(p, y, past[whole + 1], past[whole], fraction, force, dt, work, known, tolerance)


@kernel
def sensed_velocity(p, y):
    """Rate of what the position transducer shows [m/s]."""
    tau = p.position_sensor_lag_time_constant
    if tau <= 0.0:
        return y[VELOCITY]
    shown = min(tau / SHORTEST_LAG, 1.0)
    return (1.0 - shown) * y[VELOCITY] + shown * (y[POSITION] - y[LAGGED_POSITION]) / max(tau, SHORTEST_LAG)


@kernel
def outputs(p, y, acceleration, row):
    """Measured channels and inner states of one instant into `row`, shape (OUTPUTS,)."""
    row[0] = position_sensor(p, y)
    row[1] = sensed_velocity(p, y)
    row[2] = accelerometer(p, y, acceleration)
    row[3] = chamber_pressure(p, y[PRESSURE_A])
    row[4] = chamber_pressure(p, y[PRESSURE_B])
    row[5] = y[PRESSURE_SUPPLY] if p.supply_droop_resistance != 0.0 else p.supply_supply_pressure
    row[6] = y[SPOOL]


@kernel
def acceleration_now(p, y, rates):
    """Absolute acceleration of the table at state y without external force [m/s²]."""
    return right_hand_side(p, y, y, y[HELD_COMMAND], 0.0, active_states(p), rates)


@kernel
def inject(p, y, velocity, acceleration, part):
    """Correct velocity and load pressure by a part of what the sensors show beyond the simulation, in place.

    A Luenberger correction: the acceleration's error is that of the force of the oil, split between the chambers.
    velocity [m/s], acceleration [m/s²] : measured less simulated; what is not finite corrects nothing.
    """
    if math.isfinite(velocity):
        y[VELOCITY] += part * velocity
    if math.isfinite(acceleration):
        push = 0.5 * part * acceleration * (p.body_table_mass + p.body_specimen_mass) / p.body_piston_area
        y[PRESSURE_A] = max(y[PRESSURE_A] + push, min(y[PRESSURE_A], 0.0))
        y[PRESSURE_B] = max(y[PRESSURE_B] - push / p.body_area_ratio, min(y[PRESSURE_B], 0.0))


@njit
def simulate(
    p, commands, command_before, forces, track, measured, injection, y0, dt, tolerance, cutoff, pace, following, out
):
    """Simulation under recorded commands: a free run, or one that is corrected towards what was measured.

    Parameters
    ----------
    p : parameter record.
    commands : shape (n,) [-].
    command_before : acts until the first one arrives [-].
    forces : external force, shape (n,) or (0,) [N].
    track : measured position, shape (n,) or (0,) [m]: where given, the table follows it, see `follow`.
    measured : velocity [m/s] and acceleration [m/s²] of the first samples, shape (k, 2), k ≤ n: as far as they are
        given, the run is corrected towards them at the rate `injection` [1/s]; where that is 0, to find its state: at
        FIRST_RATE and then more slowly, so that the noise of FORGETS of the time so far is averaged.
    y0 : state at the first sample, shape (STATES,).
    dt : [s].
    tolerance : relative local error of a step.
    cutoff : of the filter behind the accelerometer, 0 without one [Hz].
    pace : instants of the steps by sample, shape (n, 1 + MOST) of `begin_sample`, or of no samples: kept there, or if
        `following` taken from there.
    out : result, shape (n, OUTPUTS), row k is the instant t_k, before command k acts.
    """
    y = y0.copy()
    work = workspace()
    delay = p.command_delay_delay / dt
    tracking, pacing = track.shape[0] > 0, pace.shape[0] > 0
    acceleration = acceleration_now(p, y, work[STAGE])
    force, known = 0.0, False
    begin_filter(work[FILTER], cutoff, felt(p, y, acceleration))
    for i in range(commands.shape[0]):
        if tracking:
            follow(p, y, track[i])
        outputs(p, y, acceleration, out[i])
        if cutoff > 0.0:
            out[i, 2] = scaled(p, work[FILTER, OUTPUT])
        correcting = i < measured.shape[0]
        if correcting:
            rate = injection if injection > 0.0 else 1.0 / (1.0 / FIRST_RATE + FORGETS * i * dt)
            inject(p, y, measured[i, 0] - out[i, 1], measured[i, 1] - out[i, 2], min(rate * dt, 0.5))
        before, force = force, forces[i] if forces.shape[0] > 0 else 0.0
        late, timely, fraction = delayed(commands, i, delay, command_before)
        if pacing:
            begin_sample(work[PACE], pace[i], following)
        known = known and force == before and not tracking and not correcting
        acceleration = advance_sample(p, y, late, timely, fraction, force, dt, work, known, tolerance)
        if pacing and not following:
            end_sample(work[PACE], pace[i])
        known = True
