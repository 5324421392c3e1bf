"""Tables with something undeclared, simulated independently of the package: truths for the benchmarks of discovery.

Written from the equation sheet and the definitions of the effects alone; nothing of shake_ros is imported. What differs
from the package on purpose: classical Runge–Kutta of fixed steps of 25 µs with the dry friction split off and solved
implicitly, a friction that saturates linearly at 0.7 mm/s, the valve's hysteresis as dry friction on the spool (3.19)
instead of backlash of the command, another rounding of the flow's root, and sensors of its own. A weak position loop
keeps the table centred; the recorded command is the one that reaches the valve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numba
import numpy as np
from scipy.signal import lfilter

SAMPLE = 1e-3  # [s]
SUBSTEPS = 40  # integration steps per sample
LOOP_GAIN = 2.0  # weak position loop [1/m]
POSITION_NOISE = 8e-6  # [m] at noise level 1
ACCELERATION_NOISE = 0.05  # [m/s²] at noise level 1
PRESSURE_NOISE = 2e4  # [Pa] at noise level 1
POSITION_STEP = 4.6e-6  # [m]
STATES = 18
X, V, PA, PB, S, DS, PS, FILM, Q, DQ, R, DR, B, DB, LAGA, LAGX, Z, PUSH = range(STATES)
DECLARED = {  # what a declared model may fit: names of the package → fields of Truth
    "friction.coulomb_level": "coulomb",
    "friction.stribeck_rise": "rise",
    "friction.stribeck_decay": "decay",
    "friction.viscous": "viscous",
    "bulk_modulus.modulus": "modulus",
    "leakage.internal": "internal",
    "leakage.external": "external",
    "valve.flow_coefficient": "flow",
}


class Truth(NamedTuple):
    """A table: what is declared first, then one strength (and companions) per effect; zero is absence. SI units."""

    area: float = 9.4562e-4
    volume: float = 2.4586e-4
    mass: float = 650.0
    supply: float = 206e5
    tank: float = 1e5
    omega: float = 1600.0
    damping: float = 0.736
    spool_friction: float = 0.001
    underlap: float = 0.005
    flow: float = 1.81e-7
    modulus: float = 6e8
    internal: float = 1e-12
    external: float = 1e-12
    coulomb: float = 450.0
    rise: float = 300.0
    decay: float = 40.0
    viscous: float = 400.0
    saturation: float = 7e-4  # speed at which dry friction is full [m/s]
    rounding: float = 1e4  # pressure drop about which the flow's root is rounded [Pa]
    spool_deadband: float = 0.0
    spool_hysteresis: float = 0.0
    asymmetric_flow_gain: float = 0.0
    valve_null_shift: float = 0.0
    slow_valve: float = 0.0
    turbulent_leakage: float = 0.0
    supply_droop: float = 0.0
    droop_time: float = 0.05
    tank_back_pressure: float = 0.0
    pressure_dependent_bulk_modulus: float = 0.0
    entrained_air: float = 0.0
    polytropic: float = 1.3
    soft_zone: float = 0.0
    soft_edge: float = 8e5
    soft_sharpness: float = 7e-6
    dead_volume: float = 0.0
    friction_asymmetry: float = 0.0
    friction_gradient: float = 0.0
    position_dependent_friction: float = 0.0  # curvature
    presliding_friction: float = 0.0
    film_friction: float = 0.0
    film_velocity: float = 0.2
    film_time: float = 0.2
    quadratic_drag: float = 0.0
    constant_force: float = 0.0
    stiffness_to_ground: float = 0.0
    specimen_resonance: float = 0.0
    specimen_frequency: float = 7.0
    specimen_damping: float = 0.03
    coupling_backlash: float = 0.0
    contact_stiffness: float = 3e8
    rod_mass: float = 30.0
    contact_damping: float = 0.2
    base_flexibility: float = 0.0
    base_frequency: float = 12.0
    base_damping: float = 0.05
    payload_error: float = 0.0
    accelerometer_scale: float = 0.0
    accelerometer_bias: float = 0.0
    accelerometer_lag: float = 0.0
    position_sensor_lag: float = 0.0
    command_delay: float = 0.0
    friction_bump: float = 0.0  # unlisted: additional friction about one place of the stroke [N]
    bump_place: float = 0.008
    bump_width: float = 0.004
    supply_pulsation: float = 0.0  # unlisted: periodic supply pressure, relative
    pulsation_frequency: float = 6.3
    warming_valve: float = 0.0  # unlisted: relative change of the flow gain over a recording
    warming_time: float = 3.0
    cubic_specimen: float = 0.0  # unlisted: mass on a spring that hardens with the cube [kg]
    cubic_frequency: float = 3.0
    cubic_scale: float = 0.01  # deflection at which the cubic part equals the linear one [m]
    force_bump: float = 0.0  # unlisted: push along +x about bump_place [N]
    pulse_force: float = 0.0  # unlisted: half sines along +x, pulse_length long, every pulse_every [N]
    pulse_every: float = 1.1  # [s]
    pulse_length: float = 0.12  # [s]
    bump_fading: float = 0.0  # of two quantities: time over which the push about bump_place fades, 0: in none [s]
    place_drag: float = 0.0  # of two quantities: force −c x² v|v| [N s²/m⁴]
    loaded_valve: float = 0.0  # of two quantities: flow gain (1 + c s² P_L/P_s), of opening and load pressure
    worn_bore: float = 0.0  # of two quantities: leakage between the chambers, per distance on one side [m²/(s Pa)]
    rumble: float = 0.0  # process noise: rms of a random force on the table that no command tells [N]
    rumble_rate: float = 125.0  # at which that force forgets itself [1/s]

    @property
    def velocity_gain(self) -> float:
        """Velocity of the unloaded table per full command [m/s]."""
        return self.flow * math.sqrt(0.5 * (self.supply - self.tank)) / self.area


@dataclass(frozen=True)
class Hidden:
    """How an effect is hidden: range of its strength, its place, and companions drawn log-uniformly.

    signed : the strength's sign is drawn too. listed : whether the interface has a name for it.
    """

    low: float
    high: float
    place: str
    signed: bool = False
    listed: bool = True
    companions: dict[str, tuple[float, float]] = field(default_factory=dict)


HIDDEN: dict[str, Hidden] = {
    "spool_deadband": Hidden(1e-4, 0.3, "valve"),
    "spool_hysteresis": Hidden(1e-4, 0.3, "valve"),
    "asymmetric_flow_gain": Hidden(1e-3, 0.7, "valve", signed=True),
    "valve_null_shift": Hidden(1e-4, 0.2, "valve", signed=True),
    "slow_valve": Hidden(1e-2, 0.95, "valve"),
    "turbulent_leakage": Hidden(1e-11, 8e-8, "flow"),
    "supply_droop": Hidden(1e8, 9e10, "supply", companions={"droop_time": (0.01, 0.5)}),
    "tank_back_pressure": Hidden(1e4, 8e6, "supply"),
    "pressure_dependent_bulk_modulus": Hidden(0.3, 150.0, "compressibility"),
    "entrained_air": Hidden(1e-4, 0.25, "compressibility", companions={"polytropic": (1.0, 1.4)}),
    "soft_zone": Hidden(
        1e-2, 0.95, "compressibility", companions={"soft_edge": (4e5, 1.5e6), "soft_sharpness": (4e-6, 1e-5)}
    ),
    "dead_volume": Hidden(1e-6, 8e-4, "compressibility"),
    "friction_asymmetry": Hidden(1e-2, 0.95, "friction", signed=True),
    "position_dependent_friction": Hidden(1e3, 2e7, "friction"),
    "presliding_friction": Hidden(1e-5, 8e-3, "friction"),
    "film_friction": Hidden(1e-2, 0.9, "friction", companions={"film_velocity": (0.1, 0.4), "film_time": (0.05, 1.0)}),
    "quadratic_drag": Hidden(10.0, 5e5, "friction"),
    "constant_force": Hidden(5.0, 2e4, "force", signed=True),
    "stiffness_to_ground": Hidden(100.0, 1e7, "force"),
    "specimen_resonance": Hidden(
        1.0, 400.0, "structure", companions={"specimen_frequency": (3.5, 12.0), "specimen_damping": (0.02, 0.08)}
    ),
    "coupling_backlash": Hidden(1e-6, 8e-3, "structure", companions={"rod_mass": (20.0, 50.0)}),
    "base_flexibility": Hidden(1e-10, 5e-7, "structure", companions={"base_frequency": (6.0, 25.0)}),
    "payload_error": Hidden(3.0, 1500.0, "structure"),
    "accelerometer_scale": Hidden(1e-2, 0.5, "sensor", signed=True),
    "accelerometer_bias": Hidden(1e-2, 20.0, "sensor", signed=True),
    "accelerometer_lag": Hidden(1e-4, 0.08, "sensor"),
    "position_sensor_lag": Hidden(1e-4, 0.09, "sensor"),
    "command_delay": Hidden(1e-4, 0.035, "timing"),
    "friction_bump": Hidden(10.0, 1e4, "friction", listed=False),
    "supply_pulsation": Hidden(3e-3, 0.6, "supply", listed=False, companions={"pulsation_frequency": (4.0, 9.0)}),
    "warming_valve": Hidden(3e-3, 0.9, "valve", listed=False),
    "cubic_specimen": Hidden(1.0, 400.0, "structure", listed=False, companions={"cubic_frequency": (2.0, 4.0)}),
}


@numba.njit(cache=True, nogil=True, error_model="numpy")
def rounded_root(t, d):
    """sign(d) sqrt|d|, rounded about zero."""
    return d / math.sqrt(abs(d) + t.rounding)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def modulus(t, p):
    """Tangent bulk modulus of oil with air (2.32) [Pa]."""
    m, alpha = t.pressure_dependent_bulk_modulus, t.entrained_air
    p = max(p, 1e3)
    r = t.tank / p
    if m > 0.0:
        base = max(1.0 + m * (p - t.tank) / t.modulus, 1e-2)
        liquid, slope = base ** (-1.0 / m), base ** (-(m + 1.0) / m) / t.modulus
    else:
        liquid = math.exp(-(p - t.tank) / t.modulus)
        slope = liquid / t.modulus
    volume = (1.0 - alpha) * liquid + alpha * r ** (1.0 / t.polytropic)
    return volume / ((1.0 - alpha) * slope + alpha / (t.polytropic * t.tank) * r ** (1.0 / t.polytropic + 1.0))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def dry_level(t, v, x, film):
    """Full dry friction at a speed and a place [N]."""
    level = t.coulomb + t.rise * math.exp(-t.decay * abs(v))
    level = max(level + t.friction_gradient * x + t.position_dependent_friction * x * x, 0.0)
    level += t.friction_bump * math.exp(-(((x - t.bump_place) / t.bump_width) ** 2))
    side = 1.0 if v > 0.0 else -1.0
    return level * (1.0 + t.friction_asymmetry * side) * (1.0 - t.film_friction * film)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def flows(t, y, time):
    """Flow into A, out of B, from the supply (3.17) [m³/s]."""
    s = y[S]
    s = s - min(max(s, -t.spool_deadband), t.spool_deadband)
    gain = t.flow * (1.0 + t.asymmetric_flow_gain * (1.0 if y[S] > 0.0 else -1.0))
    gain *= 1.0 + t.warming_valve * (1.0 - math.exp(-time / t.warming_time))
    if t.loaded_valve != 0.0:
        gain *= 1.0 + t.loaded_valve * y[S] * y[S] * (y[PA] - y[PB]) / t.supply
    ps = y[PS] * (1.0 + t.supply_pulsation * math.sin(2.0 * math.pi * t.pulsation_frequency * time))
    pt = t.tank + t.tank_back_pressure
    up, down = min(max(s + t.underlap, 0.0), 1.0), min(max(t.underlap - s, 0.0), 1.0)
    in_a, out_a = gain * up * rounded_root(t, ps - y[PA]), gain * down * rounded_root(t, y[PA] - pt)
    out_b, in_b = gain * up * rounded_root(t, y[PB] - pt), gain * down * rounded_root(t, ps - y[PB])
    return in_a - out_a, out_b - in_b, in_a + in_b


@numba.njit(cache=True, nogil=True, error_model="numpy")
def chambers(t, y, time, x, v, d):
    """Pressure rates (6.5), (6.6), and the supply's, into d."""
    q_a, q_b, q_s = flows(t, y, time)
    load = y[PA] - y[PB]
    soft = 1.0
    if t.soft_zone > 0.0:
        mu, edge = t.soft_sharpness, t.soft_edge
        step = math.tanh(mu * (load + edge)) - math.tanh(mu * (load - edge))
        soft -= t.soft_zone * step / (2.0 * math.tanh(mu * edge))
    across = t.internal * load + t.turbulent_leakage * rounded_root(t, load)
    if t.worn_bore > 0.0:
        across += t.worn_bore * load * max(x, 0.0)
    v_a = max(t.volume / 2.0 + t.area * x, 1e-6) + t.dead_volume
    v_b = max(t.volume / 2.0 - t.area * x, 1e-6) + t.dead_volume
    if t.entrained_air > 0.0 or t.pressure_dependent_bulk_modulus > 0.0:
        e_a, e_b = modulus(t, y[PA]), modulus(t, y[PB])
    else:
        e_a = e_b = t.modulus
    d[PA] = soft * e_a / v_a * (q_a - across - t.external * y[PA] - t.area * v)
    d[PB] = soft * e_b / v_b * (across - q_b - t.external * y[PB] + t.area * v)
    d[PS] = (t.supply - t.supply_droop * q_s - y[PS]) / t.droop_time if t.supply_droop > 0.0 else 0.0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def ground_force(t, x, time):
    """Force of the surroundings on the table [N]."""
    force = t.constant_force - t.stiffness_to_ground * x
    if t.force_bump != 0.0:
        bump = t.force_bump * math.exp(-(((x - t.bump_place) / t.bump_width) ** 2))
        force += bump * math.exp(-time / t.bump_fading) if t.bump_fading > 0.0 else bump
    if t.pulse_force != 0.0:
        within = time % t.pulse_every
        if within < t.pulse_length:
            force += t.pulse_force * math.sin(math.pi * within / t.pulse_length)
    return force


@numba.njit(cache=True, nogil=True, error_model="numpy")
def masses(t):
    """Inverse mass that the friction meets, mass of the table, mass of the base (infinite where rigid)."""
    table = t.mass + t.payload_error - t.specimen_resonance - t.cubic_specimen
    per_base = t.base_flexibility * (2.0 * math.pi * t.base_frequency) ** 2
    if t.coupling_backlash > 0.0:
        return 1.0 / t.rod_mass, table - t.rod_mass, per_base
    return 1.0 / table + per_base, table, per_base


@numba.njit(cache=True, nogil=True, error_model="numpy")
def rates(t, y, time, wanted, friction, d):
    """Rates of all states with a given dry friction force; returns the table's absolute acceleration."""
    _, mass, per_base = masses(t)
    split = t.coupling_backlash > 0.0
    x, v = y[X] + y[R], y[V] + y[DR]  # of the piston
    chambers(t, y, time, x, v, d)
    omega = t.omega * (1.0 - t.slow_valve)
    d[S], d[DS] = y[DS], omega * omega * (wanted - y[S]) - 2.0 * t.damping * omega * y[DS]
    over = abs(x) - 0.13
    stop = -1e8 * over * (1.0 if x > 0.0 else -1.0) if over > 0.0 else 0.0
    if t.presliding_friction > 0.0:
        friction = dry_level(t, v, x, y[FILM]) * y[Z]
        d[Z] = (v - abs(v) * y[Z]) / t.presliding_friction
    push = (
        t.area * (y[PA] - y[PB])
        - friction
        - t.viscous * v
        - (t.quadratic_drag + t.place_drag * x * x) * abs(v) * v
        + stop
    )
    outer = ground_force(t, y[X], time) + y[PUSH]
    w = 2.0 * math.pi * t.specimen_frequency
    spring = 0.0
    if t.specimen_resonance > 0.0:
        spring = w * w * y[Q] + 2.0 * t.specimen_damping * w * y[DQ]
    if t.cubic_specimen > 0.0:
        w = 2.0 * math.pi * t.cubic_frequency
        spring = w * w * y[Q] * (1.0 + (y[Q] / t.cubic_scale) ** 2) + 2.0 * t.specimen_damping * w * y[DQ]
    outer += (t.specimen_resonance + t.cubic_specimen) * spring
    w_b = 2.0 * math.pi * t.base_frequency
    base = -per_base * push - w_b * w_b * y[B] - 2.0 * t.base_damping * w_b * y[DB] if per_base > 0.0 else 0.0
    if split:
        half = 0.5 * t.coupling_backlash
        gone = y[R] - min(max(y[R], -half), half)
        contact = 0.0
        if gone != 0.0:
            contact = t.contact_stiffness * gone
            contact += 2.0 * t.contact_damping * math.sqrt(t.contact_stiffness * t.rod_mass) * y[DR]
            contact = max(contact, 0.0) if gone > 0.0 else min(contact, 0.0)
        a = (contact + outer) / mass
        d[R], d[DR] = y[DR], (push - contact) / t.rod_mass - a
    else:
        a = (push + outer) / mass
    d[X], d[V], d[B], d[DB] = y[V], a - base, y[DB], base
    d[Q], d[DQ] = y[DQ], -a - spring
    if t.film_friction != 0.0:
        d[FILM] = (min((abs(y[V]) / t.film_velocity) ** (2.0 / 3.0), 1.0) - y[FILM]) / t.film_time
    if t.position_sensor_lag > 0.0:
        d[LAGX] = (y[X] - y[LAGX]) / t.position_sensor_lag
    return a


@numba.njit(cache=True, nogil=True, error_model="numpy")
def regular_friction(t, y):
    """Dry friction as the state tells it: saturated velocity [N]."""
    if t.presliding_friction > 0.0:
        return 0.0  # `rates` has it from its own state
    v = y[V] + y[DR]
    return dry_level(t, v, y[X] + y[R], y[FILM]) * min(max(v / t.saturation, -1.0), 1.0)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def implicit_friction(t, y, h, per_mass, per_base):
    """Velocity after a step of dry friction alone, solved implicitly, in place."""
    v = y[V] + y[DR]
    level = dry_level(t, v, y[X] + y[R], y[FILM])
    slope = h * per_mass * level / t.saturation
    after = v / (1.0 + slope)
    if abs(after) > t.saturation:
        after = v - h * per_mass * level * (1.0 if v > 0.0 else -1.0)
    impulse = (v - after) / per_mass
    if t.coupling_backlash > 0.0:
        y[DR] += after - v
    else:
        y[V] += after - v
        y[DB] += impulse * per_base  # the base takes the reaction
        y[DQ] -= after - v + impulse * per_base  # the specimen keeps its own speed


@numba.njit(cache=True, nogil=True, error_model="numpy")
def step(t, y, time, h, u, k, work):
    """One step of size h in place under the command u."""
    wanted = min(max(u + t.valve_null_shift, -1.0), 1.0)
    held = y[S] if y[DS] == 0.0 and abs(wanted - y[S]) <= t.spool_friction + t.spool_hysteresis else math.nan
    rates(t, y, time, wanted, 0.0, k[0])
    for stage, part in ((1, 0.5), (2, 0.5), (3, 1.0)):
        for i in range(STATES):
            work[i] = y[i] + part * h * k[stage - 1, i]
        rates(t, work, time + part * h, wanted, 0.0, k[stage])
    for i in range(STATES):
        y[i] += h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
    if t.presliding_friction <= 0.0:
        per_mass, _, per_base = masses(t)
        implicit_friction(t, y, h, per_mass, per_base)
    omega = t.omega * (1.0 - t.slow_valve)
    slip = h * omega * omega * (t.spool_friction + t.spool_hysteresis)
    y[DS] = max(abs(y[DS]) - slip, 0.0) * (1.0 if y[DS] > 0.0 else -1.0)
    if held == held:  # friction holds the spool; the step without it had moved it a little
        y[S], y[DS] = held, 0.0
    if abs(y[S]) > 1.0:
        y[S], y[DS] = min(max(y[S], -1.0), 1.0), 0.0
    if t.accelerometer_lag > 0.0:
        a = rates(t, y, time + h, wanted, regular_friction(t, y), k[0])
        y[LAGA] += (1.0 - math.exp(-h / t.accelerometer_lag)) * (a - y[LAGA])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def drive(t, excitation, noise, step_size, commands, out, substeps, pushes):
    """Closed weak loop over a whole recording; `out` gets position, velocity, acceleration, both pressures.

    pushes : random force of each sample, shape (n,) or (0,) [N].
    """
    y, d = np.zeros(STATES), np.zeros(STATES)
    y[PA] = y[PB] = 0.5 * (t.supply + t.tank)
    y[PS] = t.supply
    k, work = np.zeros((4, STATES)), np.zeros(STATES)
    h = SAMPLE / substeps
    late = round(t.command_delay / h)
    for i in range(len(excitation)):
        wanted = 0.0 if i == 0 else commands[i - 1]
        a = rates(t, y, i * SAMPLE, wanted, regular_friction(t, y), d)
        seen = y[LAGX] if t.position_sensor_lag > 0.0 else y[X]
        seen = round((seen + noise[i, 0]) / step_size) * step_size if step_size > 0.0 else seen
        felt = y[LAGA] if t.accelerometer_lag > 0.0 else a
        out[i, 0], out[i, 1], out[i, 3], out[i, 4] = seen, y[V], y[PA], y[PB]
        out[i, 2] = (1.0 + t.accelerometer_scale) * felt + t.accelerometer_bias + noise[i, 1]
        commands[i] = min(max(excitation[i] - LOOP_GAIN * seen, -1.0), 1.0)
        if len(pushes) > 0:
            y[PUSH] = pushes[i]
        for j in range(substeps):
            back = (i * substeps + j - late) // substeps
            step(t, y, i * SAMPLE + j * h, h, commands[max(back, 0)], k, work)


def multisine(period: float, periods: int, low: float, high: float, rms: float, rng: Any) -> np.ndarray:
    """Full-grid multisine in command with a falling spectrum above 2 Hz and the best of 20 phase sets."""
    n = round(period / SAMPLE)
    time = np.arange(n) * SAMPLE
    lines = np.arange(max(math.ceil(low * period), 1), math.floor(high * period) + 1) / period
    level = 1.0 / np.maximum(lines, 2.0) ** 0.7
    best = None
    for _ in range(20):
        phase = rng.uniform(0.0, 2.0 * np.pi, len(lines))
        wave = level @ np.sin(2.0 * np.pi * np.outer(lines, time) + phase[:, None])
        if best is None or np.ptp(wave) / wave.std() < np.ptp(best) / best.std():
            best = wave
    assert best is not None
    return np.asarray(np.tile(best * rms / best.std(), periods))


LADDER = ((2.0, 0.27), (2.0, 0.6), (3.2, 0.31), (5.2, 0.13), (10.0, 0.18), (0.8, 0.07), (8.0, 0.3))


def excitations(seed: int, length: float = 1.0) -> dict[str, np.ndarray]:
    """Commands of the four recordings; `length` scales their durations (1: 7 + 7.5 + 6 + 6 s)."""
    rng = np.random.default_rng(seed)
    piece = np.arange(round(1.0 * length / SAMPLE)) * SAMPLE
    ladder = np.concatenate([a * np.sin(2.0 * np.pi * f * piece) for f, a in LADDER])
    pulses = np.zeros(round(6.0 * length / SAMPLE))
    at = 0.2
    while at + 0.6 < 6.0 * length:
        width, height = rng.uniform(0.08, 0.35), rng.uniform(0.15, 0.7)
        first, middle = round(at / SAMPLE), round(width / SAMPLE)
        pulses[first : first + middle] = height
        pulses[first + middle : first + 2 * middle] = -height
        at += 2.0 * width + rng.uniform(0.05, 0.25)
    return {
        "learn_ladder": ladder,
        "learn_multisine": multisine(2.5 * length, 3, 0.4, 8.0, 0.2, rng),
        "hold_multisine": multisine(3.0 * length, 2, 0.5, 7.0, 0.17, rng),
        "hold_pulses": pulses,
    }


def declared_truth(seed: int) -> Truth:
    """A table of which the declared model lacks nothing; its own values are drawn about the catalogue's."""
    rng = np.random.default_rng(1000 + seed)
    return Truth(
        flow=1.81e-7 * rng.uniform(0.92, 1.08),
        modulus=6e8 * 2.0 ** rng.uniform(-0.3, 1.0),
        internal=1e-12 * 3.0 ** rng.uniform(-1.0, 1.0),
        external=3e-13 * 3.0 ** rng.uniform(-1.0, 1.0),
        coulomb=rng.uniform(300.0, 600.0),
        rise=rng.uniform(150.0, 450.0),
        decay=rng.uniform(20.0, 60.0),
        viscous=rng.uniform(250.0, 600.0),
    )


def random_force(truth: Truth, count: int, rng: Any) -> np.ndarray:
    """Process noise: an Ornstein–Uhlenbeck force, held over each sample, shape (count,) [N]."""
    kept = math.exp(-truth.rumble_rate * SAMPLE)
    white = truth.rumble * rng.standard_normal(count)
    white[1:] *= math.sqrt(1.0 - kept * kept)
    return np.asarray(lfilter([1.0], [1.0, -kept], white))


def record(
    truth: Truth, excitation: np.ndarray, noise: float, rng: Any, substeps: int = SUBSTEPS
) -> dict[str, np.ndarray]:
    """One recording: command, position, acceleration and pressures, each (n,). `noise` scales the sensors' noise."""
    n = len(excitation)
    scatter = rng.standard_normal((n, 2)) * (POSITION_NOISE * noise, ACCELERATION_NOISE * noise)
    commands, out = np.zeros(n), np.zeros((n, 5))
    pushes = random_force(truth, n, rng) if truth.rumble > 0.0 else np.zeros(0)
    drive(truth, excitation, scatter, POSITION_STEP if noise > 0.0 else 0.0, commands, out, substeps, pushes)
    out[:, 3:] += PRESSURE_NOISE * noise * rng.spawn(1)[0].standard_normal((n, 2))
    names = "position", "velocity", "acceleration", "pressure_a", "pressure_b"
    return {"command": commands, **dict(zip(names, out.T, strict=True))}


def accelerations(truth: Truth, commands: dict[str, np.ndarray], seed: int = 0) -> np.ndarray:
    """Acceleration of the recordings to learn from, one behind the other, without noise of the sensors."""
    rng = np.random.default_rng(seed)
    learnt = [u for name, u in commands.items() if name.startswith("learn")]
    return np.concatenate([record(truth, u, 0.0, rng)["acceleration"] for u in learnt])


def acceleration_change(base: Truth, truth: Truth, commands: dict[str, np.ndarray]) -> float:
    """Relative change of the recorded acceleration over the recordings to learn from, without noise."""
    before, after = (accelerations(table, commands) for table in (base, truth))
    return float(np.linalg.norm(after - before) / np.linalg.norm(before))


def with_random_force(truth: Truth, between_repeats: float, commands: dict[str, np.ndarray]) -> Truth:
    """A table on which a random force acts, so large that recorded accelerations of one command differ by a share.

    between_repeats : rms of their difference over that of the acceleration, recordings to learn from, no sensor noise.
    """

    force = 60.0
    for _ in range(3):  # nearly in proportion: friction alone makes it less
        pushed = truth._replace(rumble=force)
        first, second = (accelerations(pushed, commands, seed) for seed in (0, 1))
        force *= between_repeats * float(np.std(first) / np.std(first - second))
    return truth._replace(rumble=force)


def with_companions(base: Truth, effect: str, seed: int) -> tuple[Truth, float]:
    """A table with the numbers that go with an effect, drawn; and the sign of its strength."""
    hidden = HIDDEN[effect]
    rng = np.random.default_rng([seed, *effect.encode()])
    drawn = {name: low * (high / low) ** rng.uniform() for name, (low, high) in hidden.companions.items()}
    return base._replace(**drawn), -1.0 if hidden.signed and rng.uniform() < 0.5 else 1.0


def with_effect(base: Truth, effect: str, severity: float, commands: dict[str, np.ndarray], seed: int) -> Truth:
    """A table in which `effect` changes the acceleration by `severity`, found by bisection of its strength.

    The strength stays within its range, so an effect that cannot change the acceleration so much changes it less.
    """
    hidden = HIDDEN[effect]
    base, sign = with_companions(base, effect, seed)
    if effect == "position_sensor_lag":  # the accelerometer does not see it: strength by the position's lag at 4 Hz
        return base._replace(position_sensor_lag=severity / (2.0 * math.pi * 4.0))
    low, high = math.log(hidden.low), math.log(hidden.high)
    for _ in range(9):
        middle = 0.5 * (low + high)
        change = acceleration_change(base, base._replace(**{effect: sign * math.exp(middle)}), commands)
        low, high = (low, middle) if not change < severity else (middle, high)
    return base._replace(**{effect: sign * math.exp(low)})
