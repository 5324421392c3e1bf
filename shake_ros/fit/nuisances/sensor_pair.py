"""What position and acceleration tell of each other: delay, lags and scale of the sensors, a base that gives way.

An anti-aliasing filter delays what passes it, and a recording does not say so. The acceleration answers the second
derivative of the position by

    g e^(−jωδ) (1 + jωτ_x)/(1 + jωτ_a)/(1 − β(ω)),  β = ω² c M ω_b²/(ω_b² − ω² + 2jζω_bω)

with the lags τ_a of the accelerometer and τ_x of the position transducer, and β where the table stands on a base that
moves (`base_flexibility`): the position is measured to the base, the acceleration is absolute, and β is the part of it
that the base has. The delay δ of the filter tells nothing of the table and is taken out of the recording; the rest
stays for the model to explain, as far as the lines show it.

A filter of second order below the highest of the lines, as slow sampling asks for, tells itself from a lag by its gain,
which stays flat and then falls faster. Otherwise delay and lag are much alike, so the delay is a first one: with what
filter it comes the fit tells (sensor_filter.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.sensors import FILTER_DELAY
from shake_ros.quantities import ShakeError
from shake_ros.signals.frequency_response import SHORTEST, FrequencyResponse, frequency_response

WINDOW = 4.0  # of the response [s]
LOWEST, HIGHEST = 1.0, 40.0  # lines that are looked at [Hz]
COHERENT = 0.95  # of a line; few windows show more by chance, so no more of its power may be noise of the position
LEAKED = 0.7  # share of a line that may come from others, from which it says nothing of its own frequency
FEWEST = 10  # lines
LAGS = np.geomspace(3e-4, 3e-2, 40)  # of the accelerometer [s]
POSITION_LAGS = np.geomspace(3e-4, 0.12, 52)  # of the position transducer [s]
SHORT = (1e-3, 4e-3)  # of the accelerometer, from which one is sought beside that of the position [s]
CUTOFFS = np.geomspace(10.0, 120.0, 26)  # of a filter that is looked for [Hz]
LOW, HIGH = (3e-4, 3e-4, 1e-7, 2.0, 1e-3, 9.0), (3e-2, 0.13, 1e-1, 80.0, 0.7, 130.0)  # of numbers_of
EARLIEST = -1e-3  # delay of the acceleration; before its position it does not come [s]
WORTH = 0.8  # fall of the cost from which a lag counts as one, or a filter
WORTH_OF_SECOND = 0.9  # the same of the other sensor's lag beside it, one number more for hundreds of lines
WORTH_OF_BASE = 0.5  # the same of a base's mode, which has three parameters
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the delay that may be a filter's
BASE = "base_flexibility"
BASES = (4.0, 7.0, 11.0, 16.0, 24.0, 35.0)  # natural frequencies from which one is sought [Hz]
AMPLIFIED = 0.05  # β at low damping and a third of the frequency, from which it is sought
OPPOSITE = -0.02  # mean gain below which it is no noise: -0.1 of an acceleration in g whose sign is turned
SLOW_AS_SCALE = 0.3  # lag times the lowest line [rad], from which a lag changes the gain of all lines alike
WIDEST = 0.05  # rms of the relative gain's departure from its mean up to which the mean is that of the sensors


@dataclass(frozen=True)
class BaseMode:
    """Mode of a base. compliance_mass : compliance times the moved mass [s²]. frequency [Hz]. damping [-]."""

    compliance_mass: float
    frequency: float
    damping: float

    def response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Absolute acceleration per acceleration to the base [-]."""
        natural = 2.0 * np.pi * self.frequency
        swinging = natural**2 - omega**2 + 2j * self.damping * natural * omega
        return np.asarray(1.0 / (1.0 - omega**2 * self.compliance_mass * natural**2 / swinging))

    def on(self, table: TableParameters) -> dict[str, float]:
        """Values by dotted name on a table."""
        values = (self.compliance_mass / table.moved_mass, self.frequency, self.damping)
        return {f"effects.{BASE}.{n}": v for n, v in zip(("compliance", "frequency", "damping"), values, strict=True)}


@dataclass(frozen=True)
class Between:
    """What shows between the sensors beside a gain and a delay.

    lag, position_lag : of the accelerometer and of the position transducer, 0 for none [s]. base : None for none.
    cutoff : of a Butterworth filter of second order behind the accelerometer, 0 for none [Hz].
    """

    lag: float = 0.0
    position_lag: float = 0.0
    base: BaseMode | None = None
    cutoff: float = 0.0

    def response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Acceleration per second derivative of the position [-]."""
        found = (1.0 + 1j * omega * self.position_lag) / (1.0 + 1j * omega * self.lag)
        if self.base is not None:
            found = found * self.base.response(omega)
        if self.cutoff:
            s = 1j * omega / (2.0 * np.pi * self.cutoff)
            found = found / (1.0 + math.sqrt(2.0) * s + s * s)
        return np.asarray(found)


@dataclass(frozen=True)
class SensorPair:
    """Delay of the accelerometer against the position, lags of both [s]; 0 where none shows.

    scale_error : of the accelerometer, None where it cannot be told [-]. base : None where none shows.
    filter_share : of the delay that comes from a filter of second order; all of it where the gain does not tell [-].
    """

    delay: float = 0.0
    lag: float = 0.0
    position_lag: float = 0.0
    scale_error: float | None = None
    base: BaseMode | None = None
    filter_share: float = 1.0


Lines = tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64]]
ALIKE = SensorPair()  # sensors that tell nothing of each other


def from_position(record: Record, answer: NDArray[np.float64] | None) -> FrequencyResponse | None:
    """Response from the position to another signal; None without either, and of a recording that is too short."""
    seconds = len(record.position) * record.sample_time
    if answer is None or not record.position_measured or seconds < 4.0 * SHORTEST * record.sample_time:
        return None
    window = max(min(WINDOW, 0.4 * seconds), SHORTEST * record.sample_time)
    return frequency_response(record.position, answer, record.sample_time, window)


def between_sensors(records: Sequence[Record]) -> Lines:
    """Angular frequency [rad/s], acceleration per second derivative of the position [-], weights; of coherent lines."""
    lines, values, weights = [], [], []
    for record in records:
        found = from_position(record, record.acceleration)
        if found is None:
            continue
        f = found.frequency
        use = (f >= LOWEST) & (f <= min(HIGHEST, 0.35 / record.sample_time)) & (found.coherence > COHERENT)
        noise = 2.0 * record.position_noise() ** 2 * record.sample_time / np.maximum(found.power, 1e-300)  # its share
        use &= (found.leaked < LEAKED) & (noise < 1.0 - COHERENT)
        lines.append(2.0 * np.pi * f[use])
        values.append(-found.response[use] / (2.0 * np.pi * f[use]) ** 2 / (1.0 - noise[use]))
        weights.append(1.0 / (1.001 - found.coherence[use]))
    if not lines:
        return np.zeros(0), np.zeros(0, dtype=np.complex128), np.zeros(0)
    return np.concatenate(lines), np.concatenate(values), np.concatenate(weights)


@dataclass(frozen=True)
class SensorResponse:
    """Lines of the acceleration per second derivative of the position. omega [rad/s], values [-], weights of sum 1."""

    omega: NDArray[np.float64]
    values: NDArray[np.complex128]
    weights: NDArray[np.float64]

    def left(self, between: Between) -> tuple[NDArray[np.float64], float, float]:
        """What is left of the logarithm beside a gain and a delay, weighted; log of the gain; the delay [s]."""
        rest, omega, w = self.values / between.response(self.omega), self.omega, self.weights
        size, angle = np.log(np.abs(rest)), np.angle(rest)
        gain, delay = float(w @ size), -float(np.sum(w * omega * angle) / np.sum(w * omega**2))
        return np.concatenate([np.sqrt(w) * (size - gain), np.sqrt(w) * (angle + omega * delay)]), gain, delay

    def cost(self, between: Between) -> float:
        """Weighted mean square of what is left."""
        rest = self.left(between)[0]
        return float(rest @ rest)

    def better(self, more: Between, found: Between, worth: float) -> Between:
        """More where its cost is less than that part of what is found leaves and no acceleration comes too early."""
        enough = self.cost(more) < worth * self.cost(found) and self.left(more)[2] > EARLIEST
        return more if enough else found

    def fitted(self, starts: Sequence[Between]) -> Between:
        """What explains most, from starts that have the same parts; each part stays."""
        low, high = np.array(LOW), np.array(HIGH)
        there = numbers_of(starts[0]) > 0.0

        def of(logarithms: NDArray[np.float64]) -> Between:
            numbers = np.zeros(len(there))
            numbers[there] = np.exp(logarithms)
            return between_of(numbers)

        bounds = np.log(low[there]), np.log(high[there])
        begin = [np.log(np.clip(numbers_of(s), 1.01 * low, 0.99 * high)[there]) for s in starts]
        found = [least_squares(lambda x: self.left(of(x))[0], b, bounds=bounds, max_nfev=60) for b in begin]
        return of(min(found, key=lambda f: float(f.cost)).x)


def numbers_of(between: Between) -> NDArray[np.float64]:
    """Lags, compliance times mass, frequency and damping of the base, cut-off; 0 where a part is not there."""
    base = between.base
    mode = (base.compliance_mass, base.frequency, base.damping) if base is not None else (0.0, 0.0, 0.0)
    return np.array([between.lag, between.position_lag, *mode, between.cutoff])


def between_of(numbers: NDArray[np.float64]) -> Between:
    """The inverse of numbers_of."""
    lag, position_lag, compliance_mass, frequency, damping, cutoff = numbers.tolist()
    base = BaseMode(compliance_mass, frequency, damping) if compliance_mass > 0.0 else None
    return Between(lag, position_lag, base, cutoff)


def shown_between(response: SensorResponse) -> Between:
    """What shows in a response: one part after the other, each where it explains enough."""

    def nearest(candidates: Sequence[Between]) -> Between:
        return response.fitted([min(candidates, key=response.cost)])

    slow, slow_position = nearest([Between(lag=v) for v in LAGS]), nearest([Between(0.0, v) for v in POSITION_LAGS])
    single = min(slow, slow_position, key=response.cost)
    found = response.better(single, Between(), WORTH)
    found = response.better(nearest([Between(cutoff=v) for v in CUTOFFS]), found, WORTH)
    besides = [Between(), single]
    if found is single:
        both = response.fitted([Between(v, slow_position.position_lag) for v in (slow.lag, *SHORT)])
        found = response.better(both, found, WORTH_OF_SECOND)
        besides += [found] if found is both else []
    for beside in besides:
        found = response.better(on_base(response, beside), found, WORTH_OF_BASE if found.base is None else WORTH)
    return found


def on_base(response: SensorResponse, beside: Between) -> Between:
    """What explains most of a response with a base that gives way beside something else."""
    modes = [BaseMode(8.0 * AMPLIFIED / (2.0 * np.pi * f) ** 2, f, 0.05) for f in BASES]
    return response.fitted([replace(beside, base=mode) for mode in modes])


def base_between(records: Sequence[Record]) -> BaseMode | None:
    """The base that the sensors show most of, however little that is; none where they tell nothing of each other."""
    response = response_of([between_sensors([record]) for record in records])
    if response is None:
        return None
    beside = replace(shown_between(response), base=None)
    return min((on_base(response, b) for b in {Between(), beside}), key=response.cost).base


def response_of(lines: Sequence[Lines]) -> SensorResponse | None:
    """The lines of all recordings; None where they are too few or their signs differ."""
    omega, values, weights = (np.concatenate(parts) for parts in zip(*lines, strict=True))
    if len(omega) < FEWEST or np.sum(weights * values.real) <= 0.0:
        return None
    return SensorResponse(omega, values, weights / np.sum(weights))


def sensor_pair(records: Sequence[Record]) -> SensorPair:
    """What shows between the sensors of all recordings; nothing where that cannot be told.

    Raises
    ------
    ShakeError : the acceleration of a recording has the wrong sign; nothing can be fitted to that.
    """
    each = [between_sensors([record]) for record in records]
    for record, (omega, values, weights) in zip(records, each, strict=True):
        if len(omega) >= FEWEST and (ratio := float(np.average(values.real, weights=weights))) < OPPOSITE:
            raise ShakeError(turned(record, ratio))
    response = response_of(each)
    if response is None:
        return ALIKE
    found = shown_between(response)
    rest, gain, delay = response.left(found)
    sizes, slowest = rest[: len(response.omega)], max(found.lag, found.position_lag)
    shows = float(sizes @ sizes) < WIDEST**2 and slowest * float(np.min(response.omega)) < SLOW_AS_SCALE
    delay += FILTER_DELAY / found.cutoff if found.cutoff else 0.0
    scale_error = float(np.exp(gain)) - 1.0 if shows else None
    share = share_of_filter(response, found, delay)
    return SensorPair(delay, found.lag, found.position_lag, scale_error, found.base, share)


def share_of_filter(response: SensorResponse, found: Between, delay: float) -> float:
    """Part of a delay [s] that comes from a filter; all of it, as with most accelerometers, where the gain is silent.

    Below the cut-off of a filter of a higher order the gain stays flat, and the delay is nearly a dead time.
    """
    if delay <= 0.0:
        return 1.0

    def cost(share: float) -> float:
        return response.cost(replace(found, cutoff=FILTER_DELAY / (share * delay) if share else 0.0))

    best = min(SHARES, key=cost)
    return best if cost(best) < WORTH * cost(1.0) else 1.0


def turned(record: Record, ratio: float) -> str:
    """A line on an acceleration whose sign is wrong. ratio : to the second derivative of the position [-]."""
    return f"{compared(record, ratio)}: one of them points the other way; import the acceleration with the scale -1"


def compared(record: Record, ratio: float) -> str:
    """How many times the second derivative of the position the acceleration is, in words."""
    return f"{record.name}: the acceleration is {ratio:.3g} times the second derivative of the position"


def advanced(values: np.ndarray, samples: float) -> np.ndarray:
    """A signal a number of samples earlier, by the phase of its spectrum: noise keeps its size.

    >>> wave = np.sin(np.arange(200) / 7.0)
    >>> round(float(np.max(np.abs(advanced(wave, 0.5) - np.sin((np.arange(200) + 0.5) / 7.0))[5:-5])), 2)
    0.0
    """
    n = len(values)
    padded = np.concatenate([values, values[::-1]])  # without a step at the seam
    spectrum = np.fft.rfft(padded)
    turned = spectrum * np.exp(2j * np.pi * np.fft.rfftfreq(2 * n) * samples)
    return np.asarray(np.fft.irfft(turned, 2 * n)[:n])


def pressed_in_time(records: Sequence[Record], late: float) -> bool:
    """Whether the load pressures are in time with the position, rather than later by a time [s]; False without any.

    What pushes a mass is in phase with its acceleration or against it, with or without a specimen; only friction is
    not.
    """
    alike = np.zeros(2)
    for record in records:
        found = from_position(record, record.pressure)
        if found is not None:
            phase = np.angle(found.response) + 2.0 * np.pi * found.frequency * np.array([[0.0], [late]])
            alike += np.sum((found.coherence * np.cos(phase) ** 2)[:, found.frequency >= LOWEST], axis=1)
    return bool(alike[0] > alike[1])


def timely(record: Record, delay: float) -> Record:
    """The recording with its acceleration earlier by a delay [s]; not valid at its end, where it came too late."""
    if record.acceleration is None or delay == 0.0:
        return record
    samples = delay / record.sample_time
    n, moved = len(record.commands), np.arange(len(record.commands)) + samples
    ends = (np.floor(moved).astype(int), np.ceil(moved).astype(int))
    valid = record.whole[np.clip(ends[0], 0, n - 1)] & record.whole[np.clip(ends[1], 0, n - 1)] & (moved <= n - 1)
    return replace(
        record,
        acceleration=advanced(record.acceleration, samples),
        delay=record.delay + delay,
        valid=valid,
        calmest=record.acceleration_noise(),  # jumps ring between the samples of an advanced signal
    )
