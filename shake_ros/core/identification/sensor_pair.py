"""What position and acceleration tell of each other: delay, lags and scale of the sensors, a base that gives way.

An anti-aliasing filter delays what passes it, and a recording does not say so: the acceleration answers the second
derivative of the position by g e^(−jωδ)/(1 + jωτ), or by g e^(−jωδ)(1 + jωτ) where the position transducer is slow, or
by g e^(−jωδ)/(1 − β(ω)) where the table stands on a base that moves (base_flexibility.py): the position is measured to
the base, the acceleration is absolute, and β = ω² c M ω_b²/(ω_b² − ω² + 2jζω_bω) is the base's part of it. Lag
and base may come together. The delay δ of the filter tells nothing of the table and is taken out of the recording; the
rest stays for the model to explain.

A filter of second order below the highest of the lines, as slow sampling asks for, tells itself from a lag by its gain,
which stays flat and then falls faster. Otherwise delay and lag are much alike, so the delay is a first one: with what
filter it comes the fit tells (sensor_filter.py).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar

from shake_ros.core.analysis.frequency_response import SHORTEST, frequency_response
from shake_ros.core.identification.recordings import Record
from shake_ros.core.plant.anti_alias import FILTER_DELAY
from shake_ros.core.quantities import ShakeError

WINDOW = 4.0  # of the response [s]
LOWEST, HIGHEST = 1.0, 40.0  # lines that are looked at [Hz]
COHERENT = 0.95  # below, the noise of the position biases the gain
FEWEST = 10  # lines
LAGS = np.geomspace(3e-4, 3e-2, 40)  # of the accelerometer [s]
POSITION_LAGS = np.geomspace(3e-4, 0.12, 52)  # of the position transducer [s]
CUTOFFS = np.geomspace(10.0, 120.0, 26)  # of a filter that is looked for [Hz]
WORTH = 0.8  # fall of the cost from which a lag counts as one, or a filter
WORTH_OF_BASE = 0.3  # the same of a base's mode, which has three parameters
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


@dataclass(frozen=True)
class SensorPair:
    """Delay and lag of the accelerometer against the position [s]; the lag is negative where it is the position's.

    scale_error : of the accelerometer, None where it cannot be told [-]. base : None where none shows.
    """

    delay: float = 0.0
    lag: float = 0.0
    scale_error: float | None = None
    base: BaseMode | None = None


NO_SENSORS = SensorPair()  # that tell of each other


def between_sensors(
    records: Sequence[Record],
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64]]:
    """Angular frequency [rad/s], acceleration per second derivative of the position [-], weights; coherent lines."""
    lines, values, weights = [], [], []
    for record in records:
        seconds = len(record.position) * record.sample_time
        if record.acceleration is None or seconds < 4.0 * SHORTEST * record.sample_time:
            continue
        window = max(min(WINDOW, 0.4 * seconds), SHORTEST * record.sample_time)
        found = frequency_response(record.position, record.acceleration, record.sample_time, window)
        f = found.frequency
        use = (f >= LOWEST) & (f <= min(HIGHEST, 0.35 / record.sample_time)) & (found.coherence > COHERENT)
        lines.append(2.0 * np.pi * f[use])
        values.append(-found.response[use] / (2.0 * np.pi * f[use]) ** 2)
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

    def left(self, explained: NDArray[np.complex128]) -> tuple[NDArray[np.float64], float, float]:
        """What a model leaves of the logarithm beside a gain and a delay, weighted; log of the gain; the delay [s]."""
        rest, omega, w = self.values / explained, self.omega, self.weights
        size, angle = np.log(np.abs(rest)), np.angle(rest)
        gain, delay = float(w @ size), -float(np.sum(w * omega * angle) / np.sum(w * omega**2))
        return np.concatenate([np.sqrt(w) * (size - gain), np.sqrt(w) * (angle + omega * delay)]), gain, delay

    def cost(self, explained: NDArray[np.complex128]) -> float:
        """Weighted mean square of what a model leaves."""
        rest = self.left(explained)[0]
        return float(rest @ rest)


def lagged(omega: NDArray[np.float64], lag: float) -> NDArray[np.complex128]:
    """SensorResponse with a lag of the accelerometer, or of the position where it is negative [s]."""
    slow = 1.0 + 1j * omega * abs(lag)
    return np.asarray(1.0 / slow if lag >= 0.0 else slow)


def filtered(omega: NDArray[np.float64], cutoff: float) -> NDArray[np.complex128]:
    """SensorResponse behind a Butterworth filter of second order [Hz]."""
    s = 1j * omega / (2.0 * np.pi * cutoff)
    return np.asarray(1.0 / (1.0 + math.sqrt(2.0) * s + s * s))


def nearest(cost: Callable[[float], float], grid: NDArray[np.float64]) -> float:
    """Where a cost is least, near the best of a grid in constant ratios."""
    near, ratio = float(min(grid, key=cost)), float(grid[1] / grid[0])
    bounds, least = sorted((near / ratio, near * ratio)), 1e-3 * abs(near)
    return float(minimize_scalar(cost, bounds=bounds, options={"xatol": least}).x)


def best_lag(response: SensorResponse) -> float:
    """The lag of a sensor that explains most; of the position where it is negative [s]."""

    def cost(lag: float) -> float:
        return response.cost(lagged(response.omega, lag))

    return min((nearest(cost, LAGS), nearest(cost, -POSITION_LAGS)), key=cost)


def best_cutoff(response: SensorResponse) -> float:
    """Cut-off of the filter that explains most [Hz]."""
    return nearest(lambda cutoff: response.cost(filtered(response.omega, cutoff)), CUTOFFS)


def base_mode(response: SensorResponse, lag: float = 0.0) -> tuple[BaseMode, float]:
    """The mode of a base that explains most, and the lag beside it [s]. lag : from which that begins; 0 for none."""
    sign, lags = math.copysign(1.0, lag), LAGS if lag >= 0.0 else POSITION_LAGS

    def mode(x: NDArray[np.float64]) -> BaseMode:
        return BaseMode(*(float(value) for value in np.exp(x[:3])))

    def beside(x: NDArray[np.float64]) -> float:
        return sign * float(np.exp(x[3])) if len(x) > 3 else 0.0

    def rest(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return response.left(mode(x).response(response.omega) * lagged(response.omega, beside(x)))[0]

    starts = [[8.0 * AMPLIFIED / (2.0 * np.pi * f) ** 2, f, 0.05] for f in BASES]
    low, high = [1e-7, 2.0, 1e-3], [1e-1, 80.0, 0.7]
    if lag:
        begin = float(np.clip(abs(lag), 1.01 * lags[0], 0.99 * lags[-1]))
        starts = [[*start, begin] for start in starts]
        low, high = [*low, lags[0]], [*high, lags[-1]]
    bounds = np.log(low), np.log(high)
    found = [least_squares(rest, np.log(start), bounds=bounds, max_nfev=60) for start in starts]
    best = min(found, key=lambda f: float(f.cost)).x
    return mode(best), beside(best)


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
    omega, values, weights = (np.concatenate(parts) for parts in zip(*each, strict=True))
    if len(omega) < FEWEST or np.sum(weights * values.real) <= 0.0:
        return SensorPair()
    response = SensorResponse(omega, values, weights / np.sum(weights))
    lag = slowest = best_lag(response)
    explained = lagged(omega, lag)
    little = response.cost(explained) >= WORTH * response.cost(lagged(omega, 0.0))
    if little or comes_before(response, explained):
        lag, explained = 0.0, lagged(omega, 0.0)
    cost, base, by_filter = response.cost(explained), None, 0.0
    cutoff = best_cutoff(response)
    if response.cost(filtered(omega, cutoff)) < WORTH * cost:
        explained, lag, by_filter = filtered(omega, cutoff), 0.0, FILTER_DELAY / cutoff
        cost = response.cost(explained)
    for mode, beside in (base_mode(response), base_mode(response, slowest)):
        both, enough = mode.response(omega) * lagged(omega, beside), WORTH_OF_BASE if base is None else WORTH
        if response.cost(both) < enough * cost and not comes_before(response, both):
            explained, lag, base, by_filter, cost = both, beside, mode, 0.0, response.cost(both)
    rest, gain, delay = response.left(explained)
    sizes = rest[: len(omega)]
    told = float(sizes @ sizes) < WIDEST**2 and abs(lag) * float(np.min(omega)) < SLOW_AS_SCALE
    return SensorPair(delay + by_filter, lag, float(np.exp(gain)) - 1.0 if told else None, base)


def comes_before(response: SensorResponse, explained: NDArray[np.complex128]) -> bool:
    """Whether an acceleration would come before its position, which none does."""
    return response.left(explained)[2] <= -1e-3


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


def timely(record: Record, delay: float) -> Record:
    """The recording with its acceleration earlier by a delay [s]; not heard at its end, where it came too late."""
    if record.acceleration is None or delay == 0.0:
        return record
    samples = delay / record.sample_time
    n, moved = len(record.commands), np.arange(len(record.commands)) + samples
    ends = (np.floor(moved).astype(int), np.ceil(moved).astype(int))
    heard = record.whole[np.clip(ends[0], 0, n - 1)] & record.whole[np.clip(ends[1], 0, n - 1)] & (moved <= n - 1)
    return replace(
        record,
        acceleration=advanced(record.acceleration, samples),
        delay=record.delay + delay,
        heard=heard,
        calmest=record.acceleration_noise(),  # jumps ring between the samples of an advanced signal
    )
