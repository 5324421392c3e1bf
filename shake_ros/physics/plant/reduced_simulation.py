"""Free-running simulation of a reduced table (6.36) with every effect at its place, at any sampling rate.

With w the force of the drive per moved mass, the third-order form splits into

    v̇ = w + g − f,    ẇ = (β_1 + β_5 |x_e|) v + (β_2 + β_4 |x_e|) w + β_3 x_e

g are forces per mass and f is dry friction; without effects w is the acceleration and this is (6.36). x_e is the
command behind delay, null shift, backlash, lag, dead band and unequal edges. Under a held command the linear part is
advanced exactly; dry friction is implicit, so that the table sticks at v = 0; the drag is taken at the mean velocity.
Verified against the matrix exponential, and against a fine explicit integration with effects.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from shake_ros.compiled import njit
from shake_ros.physics.effects.friction import dry_level
from shake_ros.physics.effects.structure import spring_force
from shake_ros.physics.effects.valve import effective_spool, flow_factor
from shake_ros.physics.plant.integration import delayed
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import REDUCED_LAYOUT
from shake_ros.physics.plant.simulation import NOTHING, series, workers
from shake_ros.physics.valve.simplified import backlash

LONGEST_STEP = 1e-3  # [s] between two evaluations of friction and forces
SPECIMEN_STEP = 2e-4  # [s] the same where a specimen swings
COLUMNS = ("position", "velocity", "acceleration", "opening", "drive")
OUTPUTS = 5

POSITION, VELOCITY, DRIVE, HELD, LAGGED, ACCELERATION, SENSED_ACCELERATION, SENSED_POSITION = range(8)
SPECIMEN, SPECIMEN_RATE, OPENING = 8, 9, 10
STATES = 11


@njit
def exact_step(a, b, h):
    """exp(M h) of M = [[0, 1], [a, b]] and the integrals of its columns.

    Returns
    -------
    (φ_11, φ_12, φ_21, φ_22, ∫φ_11, ∫φ_12); ∫φ_21 = φ_11 − 1 and ∫φ_22 = φ_12.
    """
    a = min(a, -1e-9)
    delta = 0.25 * b * b + a
    root = math.sqrt(abs(delta))
    if root * h < 1e-6:
        c, s = 1.0, h
    elif delta < 0.0:
        c, s = math.cos(root * h), math.sin(root * h) / root
    else:
        c, s = math.cosh(root * h), math.sinh(root * h) / root
    decay = math.exp(0.5 * b * h)
    f11, f12, f22 = decay * (c - 0.5 * b * s), decay * s, decay * (c + 0.5 * b * s)
    if abs(a) * h * h > 1e-6:
        i12 = (f22 - 1.0 - b * f12) / a
    else:
        i12 = 0.5 * h * h * (1.0 + b * h / 3.0 + (a + b * b) * h * h / 12.0)
    return f11, f12, a * f12, f22, f12 - b * i12, i12


@njit
def opening(p, y, u, h):
    """Mean opening x_e over a step under the command u [-]; updates the held and the lagged command."""
    wanted = min(max(u + p.valve_null_shift_offset, -1.0), 1.0)
    y[HELD] = backlash(y[HELD], wanted, p.spool_hysteresis_width)
    tau = p.slow_valve_time_constant
    mean = y[HELD]
    if tau > 0.0:
        left = math.exp(-h / tau)
        before = y[LAGGED] - y[HELD]
        mean = y[HELD] + before * (1.0 - left) * tau / h
        y[LAGGED] = y[HELD] + before * left
    else:
        y[LAGGED] = y[HELD]
    x_e = effective_spool(mean, p.spool_deadband_width)
    return x_e * flow_factor(x_e, p.asymmetric_flow_gain_asymmetry)


@njit
def dry_friction(p, position, velocity):
    """Dry friction per moved mass in the direction of a velocity [m/s²]."""
    share = p.friction_asymmetry_asymmetry
    return dry_level(p, p.coulomb_friction_force, position) * (1.0 + share if velocity > 0.0 else 1.0 - share)


@njit
def carry(p, y, x_e, place, h):
    """One step of length h in place, the opening held; `place` is the position that forces depend on [m]."""
    v, w, mass = y[VELOCITY], y[DRIVE], max(1.0 - p.specimen_resonance_mass, 0.02)
    load = abs(x_e)
    a = p.dynamics_beta1 + p.dynamics_beta5 * load
    b = p.dynamics_beta2 + p.dynamics_beta4 * load
    f11, f12, f21, f22, i11, i12 = exact_step(a / mass, b, h)
    jerk = p.dynamics_beta3 * x_e / mass
    w /= mass  # as it moves the table without its specimen
    force = p.constant_force_force - p.stiffness_to_ground_stiffness * place
    if p.specimen_resonance_mass > 0.0:
        force += spring_force(p, p.specimen_resonance_mass, y[SPECIMEN], y[SPECIMEN_RATE])
    force /= mass
    free = f11 * v + f12 * w + i12 * jerk + i11 * force
    if p.quadratic_drag_coefficient > 0.0:
        middle = 0.5 * (v + free)
        drag = p.quadratic_drag_coefficient * abs(middle) * middle / mass
        force -= drag
        free -= i11 * drag
    dry = dry_friction(p, place, free) / mass
    stuck = abs(free) <= i11 * dry
    friction = free / i11 if stuck else math.copysign(dry, free)
    force -= friction
    y[VELOCITY] = 0.0 if stuck else free - i11 * friction
    w = f21 * v + f22 * w + f12 * jerk + (f11 - 1.0) * force
    y[DRIVE] = w * mass
    y[ACCELERATION] = 0.0 if stuck and dry > 0.0 else w + force
    y[POSITION] += 0.5 * h * (v + y[VELOCITY])
    y[OPENING] = x_e


@njit
def sensors(p, y, h):
    """Low-passes of the sensors and the specimen over a step, in place, exact for what is held."""
    if p.specimen_resonance_mass > 0.0:
        y[SPECIMEN_RATE] -= h * (y[ACCELERATION] + spring_force(p, 1.0, y[SPECIMEN], y[SPECIMEN_RATE]))
        y[SPECIMEN] += h * y[SPECIMEN_RATE]
    tau = p.accelerometer_lag_time_constant
    share = math.exp(-h / tau) if tau > 0.0 else 0.0
    y[SENSED_ACCELERATION] = y[ACCELERATION] + share * (y[SENSED_ACCELERATION] - y[ACCELERATION])
    tau = p.position_sensor_lag_time_constant
    share = math.exp(-h / tau) if tau > 0.0 else 0.0
    y[SENSED_POSITION] = y[POSITION] + share * (y[SENSED_POSITION] - y[POSITION])


@njit
def hold(p, y, u, place, duration):
    """Advance y in place over `duration` under a held command."""
    longest = SPECIMEN_STEP if p.specimen_resonance_mass > 0.0 else LONGEST_STEP
    steps = max(1, math.ceil(duration / longest - 1e-9))
    h = duration / steps
    for _ in range(steps):
        carry(p, y, opening(p, y, u, h), place, h)
        sensors(p, y, h)


@njit
def outputs(p, y, row):
    """Sensed motion, opening and drive into `row`, shape (OUTPUTS,)."""
    tau = p.position_sensor_lag_time_constant
    row[0] = y[SENSED_POSITION]
    row[1] = (y[POSITION] - y[SENSED_POSITION]) / tau if tau > 1e-6 else y[VELOCITY]
    row[2] = (1.0 + p.accelerometer_scale_error) * y[SENSED_ACCELERATION] + p.accelerometer_bias_bias
    row[3] = y[OPENING]
    row[4] = y[DRIVE]


@njit
def simulate(p, commands, command_before, track, y0, dt, out):
    """Free run under recorded commands.

    Parameters
    ----------
    p : parameter record.
    commands : shape (n,) [-].
    command_before : acts until the first one arrives [-].
    track : measured position that position-dependent forces follow, shape (n,), or (0,) for the simulated one [m].
    y0 : first state, shape (STATES,).
    dt : [s].
    out : result, shape (n, OUTPUTS), row k is the instant t_k, before command k acts.
    """
    y = y0.copy()
    delay = p.command_delay_delay / dt
    for i in range(commands.shape[0]):
        outputs(p, y, out[i])
        place = track[i] + y[POSITION] - y[SENSED_POSITION] if track.shape[0] > 0 else y[POSITION]
        late, timely, fraction = delayed(commands, i, delay, command_before)
        if fraction > 1e-9:
            hold(p, y, late, place, fraction * dt)
        if fraction < 1.0:
            hold(p, y, timely, place, (1.0 - fraction) * dt)


def initial_state(vector: np.ndarray, position: float, velocity: float, command: float) -> np.ndarray:
    """State at the first sample: position [m], velocity [m/s], valve settled at the command, no acceleration."""
    y = np.zeros(STATES)
    p = REDUCED_LAYOUT.records(vector)[0]
    y[POSITION] = y[SENSED_POSITION] = position
    y[SENSED_POSITION] -= p.position_sensor_lag_time_constant * velocity
    y[VELOCITY] = velocity
    y[HELD] = y[LAGGED] = min(max(command + p.valve_null_shift_offset, -1.0), 1.0)
    return y


def run_batch(
    vectors: np.ndarray,
    starts: np.ndarray,
    commands: np.ndarray,
    sample_time: float,
    track: np.ndarray = NOTHING,
    *,
    command_before: float = 0.0,
) -> np.ndarray:
    """Simulate many parameter sets under the same commands on all cores.

    Parameters
    ----------
    vectors : shape (m, len(REDUCED_LAYOUT.names)).
    starts : shape (m, STATES).
    commands : shape (n,) [-]. sample_time [s].
    track : measured position, shape (n,) [m], or empty.
    command_before : before the first one [-].

    Returns
    -------
    shape (m, n, OUTPUTS), columns as COLUMNS.
    """
    rows = REDUCED_LAYOUT.records(vectors)
    commands = series("command", commands, len(commands))
    track = series("position", track, len(commands)) if len(track) else NOTHING
    result = np.empty((len(rows), len(commands), OUTPUTS))

    def one(i: int) -> None:
        simulate(rows[i], commands, command_before, track, starts[i], sample_time, result[i])

    with ThreadPoolExecutor(workers()) as pool:
        list(pool.map(one, range(len(rows))))
    return result


def run(
    table: TableParameters,
    commands: np.ndarray,
    sample_time: float,
    *,
    position: float = 0.0,
    velocity: float = 0.0,
    command_before: float = 0.0,
    track: np.ndarray = NOTHING,
) -> np.ndarray:
    """Simulate one recording; shape (n, OUTPUTS), columns as COLUMNS.

    position [m], velocity [m/s] : at the first sample. command_before : before it, at which the valve rests [-].
    """
    vector = table.vector()
    start = initial_state(vector, position, velocity, command_before)
    return run_batch(vector, start[None, :], commands, sample_time, track, command_before=float(command_before))[0]
