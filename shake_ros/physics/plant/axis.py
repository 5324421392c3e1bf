"""A positioning axis driven by a known force: mass, viscous and dry friction, offset, and the effects that fit it.

    M v̇ = F − F_v v − F_c sign(v) − F_0 − effects

The four-parameter model of the EMPS benchmark (Janot, Gautier, Brunot 2019). The viscous part is advanced exactly under
a held force; dry friction is implicit, so that the axis sticks at v = 0.
Verified against the closed form of sliding to rest.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from shake_ros.compiled import njit
from shake_ros.physics.effects.friction import deflection, dry_level
from shake_ros.physics.effects.unlisted import FORCE_OF_POSITION, FORCE_OF_VELOCITY, FRICTION_OF_POSITION
from shake_ros.physics.effects.unlisted import value as unlisted
from shake_ros.physics.plant.integration import delayed
from shake_ros.physics.plant.parameters import TableLayout
from shake_ros.physics.plant.simulation import NOTHING, series, workers
from shake_ros.quantities import Parameters, quantity

LONGEST_STEP = 1e-3  # [s] between two evaluations of friction and forces
PRESLIDING_STEP = 1e-4  # [s] the same where dry friction builds up over a displacement
COLUMNS = ("position", "velocity", "acceleration")
OUTPUTS = 3
POSITION, VELOCITY, ACCELERATION, BRISTLE, SENSED, CLOCK = range(6)  # the clock is held over a sample [s]
STATES = 6


@dataclass(frozen=True)
class AxisParameters(Parameters):
    """Parameters of a force-driven axis."""

    mass: float = quantity("kg", "moved mass M", low=1e-6, high=1e6)
    viscous: float = quantity("N*s/m", "viscous friction F_v", low=0.0, high=1e8)
    coulomb: float = quantity("N", "dry friction F_c", low=0.0, high=1e7)
    offset: float = quantity("N", "offset F_0 of the force", low=-1e7, high=1e7)


AXIS_LAYOUT = TableLayout("axis", {"axis": AxisParameters})


@njit
def carry(p, y, force, place, h):
    """One step of length h in place under a held force; `place` is the position that forces depend on [m]."""
    v, mass, clock = y[VELOCITY], p.axis_mass, y[CLOCK]
    share = p.friction_asymmetry_asymmetry
    viscous = p.axis_viscous * (1.0 + share if v > 0.0 else 1.0 - share)
    rate = viscous / mass
    left = math.exp(-rate * h)
    reach = (1.0 - left) / rate / mass if rate * h > 1e-9 else h / mass  # velocity that a force leaves [m/s per N]
    net = force - p.axis_offset - p.stiffness_to_ground_stiffness * place
    net -= unlisted(p, FORCE_OF_POSITION, place, velocity=v, clock=clock) + unlisted(
        p, FORCE_OF_VELOCITY, v, position=place, clock=clock
    )
    free = left * v + reach * net
    if p.quadratic_drag_coefficient > 0.0:
        middle = 0.5 * (v + free)
        drag = p.quadratic_drag_coefficient * abs(middle) * middle
        net -= drag
        free -= reach * drag
    dry = dry_level(p, p.axis_coulomb, place)
    dry = max(dry + unlisted(p, FRICTION_OF_POSITION, place, velocity=abs(v), clock=clock), 0.0)
    dry *= 1.0 + share if free > 0.0 else 1.0 - share
    distance = p.presliding_friction_distance
    if distance > 0.0:
        moved = 0.5 * h * (v + free)
        friction = dry * deflection(y[BRISTLE], 0.5 * moved, distance)
        y[BRISTLE] = deflection(y[BRISTLE], 0.5 * h * (v + free - reach * friction), distance)
        stuck = False
    else:
        stuck = abs(free) <= reach * dry
        friction = free / reach if stuck else math.copysign(dry, free)
    y[VELOCITY] = 0.0 if stuck else free - reach * friction
    y[ACCELERATION] = 0.0 if stuck else (net - friction - viscous * y[VELOCITY]) / mass
    y[POSITION] += 0.5 * h * (v + y[VELOCITY])
    tau = p.position_sensor_lag_time_constant
    left = math.exp(-h / tau) if tau > 0.0 else 0.0
    y[SENSED] = y[POSITION] + left * (y[SENSED] - y[POSITION])


@njit
def hold(p, y, force, place, duration):
    """Advance y in place over `duration` under a held force."""
    longest = PRESLIDING_STEP if p.presliding_friction_distance > 0.0 else LONGEST_STEP
    steps = max(1, math.ceil(duration / longest - 1e-9))
    for _ in range(steps):
        carry(p, y, force, place, duration / steps)


@njit
def simulate(p, forces, force_before, track, y0, dt, out):
    """Free run under recorded forces.

    Parameters
    ----------
    p : parameter record.
    forces : shape (n,) [N].
    force_before : force that acts until the first one arrives [N].
    track : measured position that position-dependent forces follow, shape (n,), or (0,) for the simulated one [m].
    y0 : first state, shape (STATES,).
    dt : [s].
    out : result, shape (n, OUTPUTS), row k is the instant t_k, before force k acts.
    """
    y = y0.copy()
    delay = p.command_delay_delay / dt
    tau = p.position_sensor_lag_time_constant
    for i in range(forces.shape[0]):
        out[i, 0] = y[SENSED]
        out[i, 1] = (y[POSITION] - y[SENSED]) / tau if tau > 1e-6 else y[VELOCITY]
        out[i, 2] = y[ACCELERATION]
        place = track[i] + y[POSITION] - y[SENSED] if track.shape[0] > 0 else y[POSITION]
        late, timely, fraction = delayed(forces, i, delay, force_before)
        if fraction > 1e-9:
            hold(p, y, late, place, fraction * dt)
        if fraction < 1.0:
            hold(p, y, timely, place, (1.0 - fraction) * dt)
        y[CLOCK] += dt


@njit
def accelerations(p, forces, force_before, velocity, position, begin, dt, out):
    """Accelerations that forces give the axis along a measured motion, shape (n,) [m/s²]; arguments as in `simulate`.

    begin : time of the recording at the first sample [s].

    Each sample starts from what was measured: nothing adds up, whatever the model.
    """
    y = np.zeros(STATES)
    delay = p.command_delay_delay / dt
    for i in range(forces.shape[0]):
        y[POSITION] = position[i]
        y[VELOCITY] = velocity[i]
        y[CLOCK] = begin + i * dt
        late, timely, fraction = delayed(forces, i, delay, force_before)
        hold(p, y, fraction * late + (1.0 - fraction) * timely, position[i], dt)
        out[i] = (y[VELOCITY] - velocity[i]) / dt


def initial_state(position: float, velocity: float, clock: float = 0.0) -> np.ndarray:
    """State at the first sample: position [m], velocity [m/s], time of the recording [s], contact unstressed."""
    y = np.zeros(STATES)
    y[POSITION] = y[SENSED] = position
    y[VELOCITY] = velocity
    y[CLOCK] = clock
    return y


def run_batch(
    vectors: np.ndarray,
    start: np.ndarray,
    forces: np.ndarray,
    sample_time: float,
    track: np.ndarray = NOTHING,
    *,
    force_before: float = 0.0,
) -> np.ndarray:
    """Simulate many parameter sets on all cores.

    Parameters
    ----------
    vectors : shape (m, len(AXIS_LAYOUT.names)).
    start : shape (STATES,).
    forces : shape (n,), or (m, n) where each set has its own [N]. sample_time [s].
    track : measured position, shape (n,) [m], or empty.
    force_before : force before the first [N].

    Returns
    -------
    shape (m, n, OUTPUTS), columns as COLUMNS.
    """
    rows = AXIS_LAYOUT.records(vectors)
    count = forces.shape[-1]
    own = np.broadcast_to(series("force", forces, count) if forces.ndim == 1 else forces, (len(rows), count))
    track = series("position", track, count) if len(track) else NOTHING
    result = np.empty((len(rows), count, OUTPUTS))

    def one(i: int) -> None:
        simulate(rows[i], np.ascontiguousarray(own[i]), force_before, track, start, sample_time, result[i])

    with ThreadPoolExecutor(workers()) as pool:
        list(pool.map(one, range(len(rows))))
    return result
