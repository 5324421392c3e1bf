"""Tables of other laboratories, simulated apart from the package: geometry, valve, friction and effects by chance.

The equations are those of hidden_tables.py (nothing of shake_ros is imported); what is drawn here is everything that
a stranger's recording does not tell: cylinder, mass, oil, valve, friction, the laboratory's sampling rate and command
in volts, the anti-aliasing filter of its accelerometer, its closed loop (velocity feedforward and position feedback,
the command held from sample to sample), null shift and bias of each run. A case hides none to four effects.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numba
import numpy as np
from scipy.signal import butter, sosfiltfilt

from benchmarks.discovery import hidden_tables as hidden

STEP = 4e-5  # largest integration step [s]
RATES = (204.8, 256.0, 500.0, 512.0, 1000.0)  # sampling of laboratories [Hz]
LEVELS = {  # of a run, in parts of what the table can do
    "learn_quake": 0.35,
    "learn_random": 0.4,
    "learn_quake_low": 0.13,
    "hold_quake": 0.3,
    "hold_random": 0.33,
}
RUNS = tuple(LEVELS)
UNTOLD = (  # what no recording of a strange table tells from its own unknown numbers
    *("valve_null_shift", "slow_valve", "tank_back_pressure", "dead_volume", "payload_error", "accelerometer_bias"),
    *("command_delay", "spool_hysteresis"),
)
EFFECTS = tuple(n for n, h in hidden.HIDDEN.items() if h.listed and n not in UNTOLD)
COUNTS = (0, 1, 1, 2, 2, 3, 4)  # effects hidden in a case, drawn from these
SEVERITY = (0.05, 0.25)  # relative change of the acceleration by each effect


class Laboratory(NamedTuple):
    """How a laboratory records. rate [Hz]; volts : full scale; anti_alias [Hz]; step, noise : of the position [m]."""

    rate: float
    volts: float
    anti_alias: float
    step: float
    noise: float
    feedforward: float
    feedback: float


@dataclass(frozen=True)
class Case:
    """One table: its truth, its laboratory, and the effects hidden in it."""

    seed: int
    truth: hidden.Truth
    laboratory: Laboratory
    effects: tuple[str, ...]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def drive(t, lab, reference, noise, null, substeps, second_order, out):
    """Closed loop over a recording; out: command [-], position [m], filtered acceleration [m/s²]; shape (n, 3 or 4).

    A fourth column gets the load pressure [Pa].
    """
    y, d = np.zeros(hidden.STATES), np.zeros(hidden.STATES)
    y[hidden.PA] = y[hidden.PB] = 0.5 * (t.supply + t.tank)
    y[hidden.PS] = t.supply
    k, work = np.zeros((4, hidden.STATES)), np.zeros(hidden.STATES)
    h = 1.0 / lab.rate / substeps
    filtered = np.zeros(2)
    held = 0.0
    for i in range(len(reference)):
        seen = y[hidden.LAGX] if t.position_sensor_lag > 0.0 else y[hidden.X]
        seen += noise[i, 0]
        if lab.step > 0.0:
            seen = round(seen / lab.step) * lab.step
        out[i, 1], out[i, 2] = seen, filtered[0]
        if out.shape[1] > 3:
            out[i, 3] = y[hidden.PA] - y[hidden.PB]
        command = lab.feedforward * reference[i, 1] + lab.feedback * (reference[i, 0] - seen)
        command = min(max(command, -1.0), 1.0)
        out[i, 0] = command
        held, before = command, held
        late = round(t.command_delay / h)
        for j in range(substeps):
            u = before if j < late else held
            hidden.step(t, y, (i * substeps + j) * h, h, u + null, k, work)
            a = hidden.rates(t, y, (i * substeps + j + 1) * h, u + null, hidden.regular_friction(t, y), d)
            felt = y[hidden.LAGA] if t.accelerometer_lag > 0.0 else a
            felt *= 1.0 + t.accelerometer_scale
            x_0, x_1 = filtered[0], filtered[1]
            filtered[0] = second_order[0] * x_0 + second_order[1] * x_1 + second_order[4] * felt
            filtered[1] = second_order[2] * x_0 + second_order[3] * x_1 + second_order[5] * felt


def butterworth(frequency: float, h: float) -> np.ndarray:
    """Exact step of a second-order Butterworth filter under a held input: A row by row, then B, shape (6,)."""
    w, z = 2.0 * math.pi * frequency, math.sqrt(0.5)
    wd, decay = w * math.sqrt(1.0 - z * z), math.exp(-z * w * h)
    c, s = math.cos(wd * h), math.sin(wd * h)
    a_00, a_01 = decay * (c + z * w / wd * s), decay * s / wd
    a_10, a_11 = -decay * w * w / wd * s, decay * (c - z * w / wd * s)
    return np.array([a_00, a_01, a_10, a_11, 1.0 - a_00, -a_10])


def table(rng: Any) -> hidden.Truth:
    """A table with geometry, valve and friction by chance."""
    area = 10.0 ** rng.uniform(-3.3, -2.4)
    supply, tank = rng.uniform(140e5, 280e5), 1e5
    mass = (supply - tank) * area / rng.uniform(15.0, 60.0)
    volume = area * rng.uniform(0.25, 0.7)
    omega_h = 2.0 * math.pi * rng.uniform(9.0, 35.0)
    modulus = omega_h**2 * volume * mass / (4.0 * area**2)
    gain = rng.uniform(0.4, 2.0)
    flow = gain * area / math.sqrt(0.5 * (supply - tank))
    friction = mass * 10.0 ** rng.uniform(-1.3, 0.0)
    stiff = math.sqrt(modulus * mass / volume) / area
    spool_friction = float(rng.choice((0.0, 5e-4, 1e-3, 2e-3)))
    return hidden.Truth(
        area=area,
        volume=volume,
        mass=mass,
        supply=supply,
        tank=tank,
        omega=2.0 * math.pi * rng.uniform(40.0, 140.0),
        damping=rng.uniform(0.6, 1.0),
        spool_friction=spool_friction,
        underlap=rng.uniform(0.0, 0.006),
        flow=flow,
        modulus=modulus,
        internal=rng.uniform(0.02, 0.08) / stiff,
        external=0.0,
        coulomb=friction,
        rise=friction * rng.uniform(0.1, 0.8),
        decay=rng.uniform(15.0, 60.0),
        viscous=mass * rng.uniform(0.2, 1.5),
        saturation=rng.uniform(5e-4, 2e-3),
        command_delay=rng.uniform(0.0, 3e-3),
    )


def laboratory(truth: hidden.Truth, rng: Any) -> Laboratory:
    """A laboratory for a table."""
    rate = float(rng.choice(RATES))
    gain = truth.velocity_gain
    volts = float(rng.choice([1.0, 10.0]))
    return Laboratory(rate, volts, 0.4 * rate, 2.0 ** rng.integers(-18, -15), 3e-6, 0.9 / gain, 2.0 / gain)


def reference(name: str, truth: hidden.Truth, rate: float, seconds: float, rng: Any) -> np.ndarray:
    """Position [m] and velocity [m/s] that the loop is to follow, shape (n, 2)."""
    n = round(seconds * rate)
    time = np.arange(n) / rate
    low, high = (0.8, 12.0) if "quake" in name else (1.5, 25.0)
    wave = sosfiltfilt(
        butter(2, [low, min(high, 0.35 * rate)], "bandpass", fs=rate, output="sos"), rng.standard_normal(n)
    )
    if "quake" in name:
        wave *= (time / 5.0) * np.exp(1.0 - time / 5.0)
    wave *= np.minimum(1.0, np.minimum(time, time[-1] - time))
    most = usual(truth)
    velocity = sosfiltfilt(butter(2, 0.4, "highpass", fs=rate, output="sos"), np.cumsum(wave) / rate)
    position = sosfiltfilt(butter(2, 0.4, "highpass", fs=rate, output="sos"), np.cumsum(velocity) / rate)
    size = min(most["acceleration"] / np.max(np.abs(wave)), most["velocity"] / np.max(np.abs(velocity)))
    size = min(LEVELS[name] / max(LEVELS.values()) * size, most["position"] / float(np.max(np.abs(position))))
    return size * np.column_stack([position, velocity])


def usual(truth: hidden.Truth) -> dict[str, float]:
    """The largest position [m], velocity [m/s] and acceleration [m/s²] of a laboratory's usual tests."""
    level, reach = max(LEVELS.values()), (truth.supply - truth.tank) * truth.area / truth.mass
    return {"position": 0.06, "velocity": level * truth.velocity_gain, "acceleration": level * reach}


def record(
    case: Case, name: str, seconds: float = 32.0, noise: float = 1.0, pressures: bool = False
) -> dict[str, np.ndarray]:
    """One run as the laboratory hands it over: time, command in volts, position, acceleration, each (n,).

    pressures : with the load pressure as well, whose noise is half a per cent of its size and its offset a tenth.
    """
    rng = np.random.default_rng([case.seed, RUNS.index(name), 7])
    return played(case, reference(name, case.truth, case.laboratory.rate, seconds, rng), rng, noise, pressures)


def played(
    case: Case, wanted: np.ndarray, rng: Any, noise: float = 1.0, pressures: bool = False
) -> dict[str, np.ndarray]:
    """The run of a reference, position [m] and velocity [m/s], shape (n, 2)."""
    lab, truth = case.laboratory, case.truth
    scatter = noise * lab.noise * rng.standard_normal((len(wanted), 1))
    null, bias = noise * 0.006 * rng.standard_normal(), noise * 0.03 * rng.standard_normal()
    substeps = math.ceil(1.0 / lab.rate / STEP)
    out = np.zeros((len(wanted), 4))
    drive(truth, lab, wanted, scatter, null, substeps, butterworth(lab.anti_alias, 1.0 / lab.rate / substeps), out)
    size = 0.004 * float(np.std(out[:, 2])) + 0.004
    felt = out[:, 2] + bias + noise * size * rng.standard_normal(len(wanted))
    load = out[:, 3] + float(np.std(out[:, 3])) * (0.1 + 0.005 * rng.spawn(1)[0].standard_normal(len(wanted)))
    return {
        "time": np.arange(len(wanted)) / lab.rate,
        "command": lab.volts * out[:, 0],
        "position": out[:, 1],
        "acceleration": felt,
        "noise": np.array(size),
        **({"pressure_load": load} if pressures else {}),
    }


def severity(case: Case, truth: hidden.Truth) -> float:
    """Relative change of the acceleration against the case's own table over a short earthquake."""
    a = [
        record(Case(case.seed, t, case.laboratory, ()), "learn_quake", 10.0, 0.0)["acceleration"]
        for t in (case.truth, truth)
    ]
    return float(np.std(a[1] - a[0]) / np.std(a[0]))


def hide(case: Case, effect: str, rng: Any) -> hidden.Truth:
    """The case's table with one effect more, whose strength changes the acceleration by a drawn share."""
    kind = hidden.HIDDEN[effect]
    drawn = {name: low * (high / low) ** rng.uniform() for name, (low, high) in kind.companions.items()}
    sign = -1.0 if kind.signed and rng.uniform() < 0.5 else 1.0
    wanted, base = rng.uniform(*SEVERITY), case.truth._replace(**drawn)
    low, high = math.log(kind.low), math.log(kind.high)
    for _ in range(8):
        middle = 0.5 * (low + high)
        change = severity(case, base._replace(**{effect: sign * math.exp(middle)}))
        low, high = (low, middle) if not change < wanted else (middle, high)
    return base._replace(**{effect: sign * math.exp(low)})


def case_of(seed: int, most: int = max(COUNTS)) -> Case:
    """The case of a seed, with no more than `most` of its effects hidden."""
    rng = np.random.default_rng([seed, 2026])
    truth = table(rng)
    case = Case(seed, truth, laboratory(truth, rng), ())
    effects = tuple(str(e) for e in rng.choice(EFFECTS, rng.choice(COUNTS), replace=False))[:most]
    for effect in effects:
        case = Case(seed, hide(case, effect, rng), case.laboratory, ())
    return Case(seed, case.truth, case.laboratory, effects)
