"""The linear table nearest to the measured response from command to velocity, with a flexible specimen where one shows.

    G(jω) = K e^(−jωτ) / (1 + jωβ + (2ζ jω/ω_h − (ω/ω_h)²) M(ω)),
    M(ω) = B(ω) (1 − p + p (1 + 2ζ_s jr)/(1 − r² + 2ζ_s jr)),  r = ω/ω_s

M is what the oil column carries, in parts of the moved mass: of the share p, on a spring, more or less than its weight,
and where the base gives way all of it moves B times as much as the piston in its cylinder (BaseMode,
nuisances/sensor_pair.py). The oil column is damped by leakage, and by friction, whose β is the time by which it holds
the table back. Only lines count that the command excites and that are coherent: in closed loop the rest answers the
sensor's noise.

It shows a command that is recorded after it acted: the table seems to move before it is told to. A logger that takes
the command from another program, or through a filter, has it late. The delay of the linear table contains dead time and
lag of the valve, and is above zero for every table. Where a delay below zero explains the response clearly better than
any above, the recorded command is late; where the lines do not reach the hydraulic frequency, its damping explains
either, and nothing is moved. No dead time of a model explains a late command, so the commands are moved to where a
delay is left. The dead time that is found counts from there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares
from scipy.signal import welch

from shake_ros.fit.nuisances.prepared import Prepared, slow
from shake_ros.fit.nuisances.sensor_pair import ALIKE, SensorPair
from shake_ros.fit.records import Record
from shake_ros.quantities import ShakeError
from shake_ros.signals.frequency_response import SHORTEST, frequency_response

WINDOW = 4.0  # of the response [s]
LOWEST, HIGHEST = 0.7, 60.0  # lines that are looked at [Hz]
COHERENT, AROUND = 0.3, 0.7  # coherence of a line and mean of it and its neighbours, below which it is left out …
SHAKEN = 0.5  # … and this mean where something beside the command shakes the table
EXCITED = 3e-3  # of the largest power density of the command's slope, below which a line is left out
NEIGHBOURS = 5  # lines that a mean is taken over
FEWEST = 5  # lines
LEFT = 0.02  # misfit of a line from which it counts less than by its square
BOUNDS = (  # K, τ, ω_h, ζ, β
    *((1e-4, 1e4), (1e-5, 0.05), (2.0 * math.pi * 1.5, 2.0 * math.pi * 150.0), (0.01, 2.0), (1e-6, 0.05)),
)
SPECIMEN_BOUNDS = ((0.005, 0.8), (2.0 * math.pi * 1.0, 2.0 * math.pi * 60.0), (0.003, 0.5))  # p, ω_s, ζ_s
DRAG = 1e-3  # β at first [s]
ROUGH, FINISHED = 6, 4  # evaluations of a fit from each start with a specimen, and how many of the best are finished
WORTH = 0.8  # cost in parts of that of the table without a specimen, up to which the specimen shows


@dataclass(frozen=True)
class SpecimenMode:
    """First mode of a specimen. share : of the moved mass [-]; frequency [Hz] on a table at rest; damping [-]."""

    share: float
    frequency: float
    damping: float


@dataclass(frozen=True)
class LinearTable:
    """Velocity gain [m/s per command], delay [s], hydraulic frequency of the whole mass [rad/s], damping [-].

    drag : time by which friction holds it back [s]. seen_to : highest line that counts [rad/s]; a hydraulic frequency
    beyond it is only a guess. specimen : None where none shows. cost : what it leaves of the response, a robust mean
    square of the logarithm.
    """

    gain: float
    delay: float
    omega: float
    damping: float
    drag: float
    seen_to: float
    cost: float
    specimen: SpecimenMode | None = None


def response(
    parameters: NDArray[np.float64], omega: NDArray[np.float64], base: NDArray[np.complex128] | float = 1.0
) -> NDArray[np.complex128]:
    """G at angular frequencies [rad/s]; parameters : K, τ, ω_h, ζ, β and, with a specimen, p, ω_s, ζ_s. base : B.

    >>> bool(abs(response(np.array([2.0, 0.0, 60.0, 0.1, 0.0]), np.array([1e-3]))[0] - 2.0) < 1e-3)
    True
    """
    gain, delay, omega_h, damping, drag = parameters[:5]
    mass: NDArray[np.complex128] = np.ones(len(omega), dtype=np.complex128)
    if len(parameters) > 5:
        share, omega_s, damping_s = parameters[5:]
        r = omega / omega_s
        mass += share * ((1.0 + 2j * damping_s * r) / (1.0 - r**2 + 2j * damping_s * r) - 1.0)
    below = 1.0 + 1j * omega * drag + (2j * damping * omega / omega_h - (omega / omega_h) ** 2) * mass * base
    return np.asarray(gain * np.exp(-1j * omega * delay) / below)


def measured_response(
    records: Sequence[Record],
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64]]:
    """Angular frequency [rad/s], velocity per command [m/s], weight (sum 1) of the lines that count.

    Raises
    ------
    ShakeError : the motion does not follow the command.
    """
    lines, values, weights = [], [], []
    for record in records:
        seconds = len(record.commands) * record.sample_time
        window = max(min(WINDOW, 0.4 * seconds), SHORTEST * record.sample_time)
        found = frequency_response(record.commands, record.position, record.sample_time, window)
        f, around = found.frequency, uniform_filter1d(found.coherence, NEIGHBOURS)
        at, power = welch(record.commands, 1.0 / record.sample_time, nperseg=round(window / record.sample_time))
        density = f**2 * np.interp(f, at, uniform_filter1d(power, NEIGHBOURS))
        use = (f >= LOWEST) & (f <= min(HIGHEST, 0.35 / record.sample_time)) & (found.coherence > COHERENT)
        use &= (around > (AROUND if record.explained is None else SHAKEN)) & (density > EXCITED * np.max(density))
        lines.append(2.0 * math.pi * f[use])
        values.append(2j * math.pi * f[use] * found.response[use])
        weights.append(around[use] / (1.05 - around[use]))
    omega, measured, weight = (np.concatenate(x) for x in (lines, values, weights))
    if len(omega) < FEWEST:
        names = ", ".join(dict.fromkeys(r.name for r in records))
        raise ShakeError(f"{names}: the position does not follow the command (no coherent frequency)")
    return omega, measured, weight / np.sum(weight)


def linear_table(records: Sequence[Record], sensors: SensorPair = ALIKE) -> LinearTable:
    """The linear table nearest to the measured response.

    Parameters
    ----------
    sensors : a slow position transducer is no part of the table, and a base that gives way is no specimen.

    Raises
    ------
    ShakeError : the motion does not follow the command, or goes against it.
    """
    omega, measured, weight = measured_response(records)
    measured = measured * (1.0 + 1j * omega * sensors.position_lag)
    base = sensors.base.response(omega) if sensors.base is not None else 1.0
    gain = slow_gain(records)
    if gain <= 0.0:
        names = ", ".join(dict.fromkeys(r.name for r in records))
        raise ShakeError(f"{names}: the velocity goes against the command; import one of them with the scale -1")

    def left(logarithms: NDArray[np.float64]) -> NDArray[np.float64]:
        quotient = measured / response(np.exp(logarithms), omega, base)
        error = np.sqrt(weight) * (np.log(np.abs(quotient)) + 1j * np.angle(quotient))
        return np.nan_to_num(np.concatenate([error.real, error.imag]), nan=10.0, posinf=10.0, neginf=-10.0)

    def fitted(start: ArrayLike, evaluations: int = 40) -> tuple[float, NDArray[np.float64]]:
        first = np.log(start)
        low, high = np.log(np.array((*BOUNDS, *SPECIMEN_BOUNDS)[: len(first)])).T
        at = np.clip(first, low + 1e-6, high - 1e-6)
        found = least_squares(left, at, bounds=(low, high), loss="soft_l1", f_scale=LEFT, max_nfev=evaluations)
        return float(found.cost), np.exp(found.x)

    hertz = 2.0 * math.pi
    columns = [[gain, 3e-3, hertz * f, 0.15, DRAG] for f in np.geomspace(4.0, 60.0, 7)]
    plain = min((fitted(c) for c in columns), key=lambda x: x[0])
    starts = np.geomspace(2.0, min(30.0, float(np.max(omega)) / hertz), 12)
    near = [plain[1].tolist(), *columns[2::2]]
    rough = [fitted([*c, 0.3, hertz * f, 0.05], ROUGH) for c in near for f in starts]
    best = min((fitted(x) for _, x in sorted(rough, key=lambda x: x[0])[:FINISHED]), key=lambda x: x[0])
    shows = best[0] < WORTH * plain[0]
    cost, values = best if shows else plain
    mode = SpecimenMode(float(values[5]), float(values[6]) / hertz, float(values[7])) if shows else None
    gain, delay, omega_h, damping, drag = (float(v) for v in values[:5])
    return LinearTable(gain, delay, omega_h, damping, drag, float(np.max(omega)), cost, mode)


def slow_gain(records: Sequence[Record]) -> float:
    """Velocity per command of the slow motion [m/s]."""
    cross = power = 0.0
    for record in records:
        u, v = (slow(x, record.sample_time)[record.start :] for x in (record.commands, record.velocity))
        cross += float((u - u.mean()) @ (v - v.mean())) * record.sample_time
        power += float((u - u.mean()) @ (u - u.mean())) * record.sample_time
    return cross / max(power, 1e-300)


LEAD = 0.02  # by which commands are earlier for a look at a delay below zero [s]
DELAY_LEFT = 5e-3  # delay that a late command is left with: dead time and valve of a usual table [s]


def lead(records: Sequence[Record]) -> float:
    """Time by which the motion comes before the held command [s]; 0 where a delay explains the response as well.

    A command that is held from sample to sample is half a sample late by itself, in a simulation as well.
    """
    held = 0.5 * min(r.sample_time for r in records)
    try:
        moved = linear_table([earlier(r, LEAD) for r in records])
        ahead = LEAD + held - moved.delay
        late = ahead > 0.0 and moved.cost < WORTH * linear_table(records).cost
    except ShakeError:  # no coherent line
        return 0.0
    return ahead if late else 0.0


def earlier(record: Record, time: float, pressure: bool = False) -> Record:
    """The recording with its command earlier by a time [s], to whole samples and the fraction between two of them.

    pressure : whether its load pressure is as late.
    """
    samples = time / record.sample_time
    whole, part = int(samples), samples - int(samples)

    def moved(values: np.ndarray) -> np.ndarray:
        return np.asarray((1.0 - part) * values + part * np.append(values[1:], values[-1]))

    commands = moved(record.commands)
    cut = record.part(slice(0, len(commands) - whole))
    if pressure and record.pressure is not None:
        cut = replace(cut, pressure=moved(record.pressure)[whole:])
    command_before = float(commands[whole - 1]) if whole else record.command_before
    return replace(cut, commands=commands[whole:], command_before=command_before)


def in_time(data: Prepared) -> Prepared:
    """The recordings with their commands moved to where they are before the motion, where they were behind it."""
    first = lead(data.estimation)
    if not first:
        return data
    return moved_ahead(data, DELAY_LEFT + first)


def moved_ahead(data: Prepared, time: float, pressure: bool = False) -> Prepared:
    """The recordings with their commands, and their load pressures if these are as late, earlier by a time [s], up to
    whole samples.
    """
    step = max(r.sample_time for r in data.estimation)
    ahead = step * np.ceil(time / step)
    both = [[earlier(r, ahead, pressure) for r in records] for records in (data.estimation, data.validation)]
    return replace(data, estimation=both[0], validation=both[1], ahead=float(ahead))
