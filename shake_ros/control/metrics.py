"""What runs of the closed loop are judged by, one by one and side by side.

J1, J2 and J3 are the delay, the tracking error and the peak error of Silva, Gomez, Maghareh, Dyke and Spencer,
Mechanical Systems and Signal Processing 135 (2020) 106381, here with the mean taken off the reference and J1 refined
between samples. All compare the true motion, without sensor noise, with the reference.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.closed_loop import ClosedLoop, command_travel, normalised_error
from shake_ros.control.reference.motion import columns, product, smooth_step
from shake_ros.quantities import Parameters, describe, quantity
from shake_ros.signals.response_spectrum import response_spectrum
from shake_ros.signals.thd import harmonics

Array = NDArray[np.float64]
LONGEST_DELAY = 0.06  # [s] within which J1 is sought
DAMPING = 0.05  # ξ of the response spectrum [-]
LOWEST, HIGHEST, FREQUENCIES = 0.5, 15.0, 30  # of the response spectrum [Hz], evenly spaced in the logarithm
ORDERS = 25  # harmonics of the THD
AT_LIMIT = 1.0 - 1e-9  # share of the limit from which a command counts as limited
STILL_MOVING = 0.5  # rms acceleration at the final rest, over that of the reference, from which a loop is unstable
RINGING_ABOVE, RINGING_WINDOW = 15.0, 0.5  # [Hz] beyond a reference's band, [s] of `ringing`
FADE, REST = 1.0, 1.0  # [s] of `come_to_rest`
SETTLING = 2.0  # [s] of `settle_first`
ASIDE = 0.002  # [m] from its reference at which a loop is closed that is looked at: a limit cycle needs a push to begin
LOST_TRACKING = 1.0  # position error from which it is: no better than a table that stands still


@dataclass(frozen=True)
class Metrics(Parameters):
    """Figures of one run; NaN where a run has none (THD without a sine, anything of a run that was lost)."""

    delay: float = quantity("s", "J1, delay of the position behind the reference", default=math.nan)
    position_error: float = quantity("-", "J2 of the position, normalised rms error", default=math.nan)
    velocity_error: float = quantity("-", "J2 of the velocity", default=math.nan)
    acceleration_error: float = quantity("-", "J2 of the acceleration", default=math.nan)
    position_peak_error: float = quantity("-", "J3 of the position, largest error over largest value", default=math.nan)
    velocity_peak_error: float = quantity("-", "J3 of the velocity", default=math.nan)
    spectrum_error: float = quantity(
        "-", "root mean square relative error of the response spectrum, 5 %, 0.5 to 15 Hz", default=math.nan
    )
    spectrum_largest_error: float = quantity("-", "largest relative error of that spectrum", default=math.nan)
    thd: float = quantity("-", "harmonic distortion of the acceleration, sines only", default=math.nan)
    command_travel: float = quantity("1/s", "mean travel of the valve command", default=math.nan)
    time_at_limit: float = quantity("-", "share of the time with the command at its limit", default=math.nan)
    largest_position: float = quantity("m", "largest distance from mid-stroke", default=math.nan)
    end_stop: bool = quantity("-", "whether an end stop was touched", default=False)
    unstable: bool = quantity("-", "whether the closed loop diverged or kept oscillating", default=False)

    def __post_init__(self) -> None:
        """No bounds: figures may be NaN."""


UNITS = {name: str(data["unit"]) for name, data in describe(Metrics).items()}
MEANINGS = {name: str(data["meaning"]) for name, data in describe(Metrics).items()}


@dataclass(frozen=True)
class Judged:
    """The part of a reference that counts."""

    # first, last: samples between which errors count (soft start and stop left out)
    first: int
    last: int
    rest: int  # from here on the reference is at rest
    frequency: float  # of a sine [Hz], 0 for other references
    spectrum: Array  # of the reference, from `spectrum_of`


def spectrum_of(acceleration: Array, sample_time: float) -> Array:
    """Absolute acceleration spectrum at 5 % damping over 0.5 … 15 Hz, (FREQUENCIES,) [m/s²]."""
    frequencies = np.geomspace(LOWEST, HIGHEST, FREQUENCIES)
    return np.abs(response_spectrum(acceleration, sample_time, frequencies, DAMPING).acceleration)


def ringing(run: ClosedLoop) -> float:
    """How much the table shakes where the reference does not: the part of the acceleration's error above RINGING_ABOVE.

    Largest rms of it over a window, relative to the rms of the reference's acceleration over the whole run [-];
    infinite for a run that was lost.

    >>> t = np.arange(4000) * 1e-3
    >>> wanted = np.column_stack([0 * t, 0 * t, np.sin(12.0 * t)])
    >>> found = wanted + np.column_stack([0 * t, 0 * t, 0.2 * np.sin(200.0 * t) + 0.2 * np.sin(9.0 * t)])
    >>> round(ringing(ClosedLoop(1e-3, wanted, wanted, found, 0 * t, wanted)), 2)
    0.2
    """
    error = run.truth[:, 2] - run.reference[:, 2]
    size = float(np.sqrt(np.mean(run.reference[:, 2] ** 2)))
    if not (np.isfinite(error).all() and size > 0.0):
        return math.inf
    spectrum = np.fft.rfft(error)
    spectrum[np.fft.rfftfreq(len(error), run.sample_time) < RINGING_ABOVE] = 0.0
    square = np.cumsum(np.append(0.0, np.fft.irfft(spectrum, len(error)) ** 2))
    n = min(round(RINGING_WINDOW / run.sample_time), len(error))
    return float(np.sqrt(np.max(square[n:] - square[:-n]) / n)) / size


def come_to_rest(reference: Array, sample_time: float) -> Array:
    """A reference (n, 3) that is faded to rest at mid-stroke over its last second, with a second of rest behind it.

    >>> rows = come_to_rest(np.tile([0.01, 0.0, 0.0], (3000, 1)), 1e-3)
    >>> len(rows), float(rows[1999, 0]), round(float(rows[2500, 0]), 6), rows[3000].tolist()
    (4000, 0.01, 0.005, [0.0, 0.0, 0.0])
    """
    left: Array = np.arange(len(reference), 0, -1, dtype=np.float64) * sample_time / FADE
    value, slope, curvature = smooth_step(left)
    fade = value, -slope / FADE, curvature / FADE**2
    return np.vstack([product(fade, columns(reference)), np.zeros((round(REST / sample_time), 3))])


def settle_first(reference: Array, sample_time: float) -> Array:
    """A reference (n, 3) behind SETTLING seconds of rest at its first place.

    A table is at rest under its loop before a motion. A simulated one starts with equal pressures and a valve at its
    electrical zero: under a constant force or with another null it first moves, which is no fault of what follows.

    >>> settle_first(np.array([[0.01, 0.2, 3.0]]), 1.0).tolist()
    [[0.01, 0.0, 0.0], [0.01, 0.0, 0.0], [0.01, 0.2, 3.0]]
    """
    ahead = np.zeros((round(SETTLING / sample_time), 3))
    ahead[:, 0] = reference[0, 0]
    return np.vstack([ahead, reference])


def still_moving(run: ClosedLoop) -> float:
    """Movement at the rest of `come_to_rest`: rms acceleration over its second half, over that of the reference [-].

    A limit cycle below 15 Hz, which `ringing` does not see, is seen here; infinite for a run that was lost.
    """
    found = run.truth[-round(0.5 * REST / run.sample_time) :, 2]
    size = float(np.sqrt(np.mean(run.reference[:, 2] ** 2)))
    if not (np.isfinite(run.truth).all() and size > 0.0):
        return math.inf
    return float(np.sqrt(np.mean(found**2))) / size


def tracking_delay(reference: Array, position: Array, sample_time: float) -> float:
    """J1, by which the position lags the reference [s]: the peak of their normalised cross-correlation.

    A parabola through the peak and its neighbours refines it between samples. Negative where the position leads.

    >>> t = np.arange(3000) * 0.001
    >>> round(tracking_delay(np.sin(9.0 * t), np.sin(9.0 * (t - 0.0123)), 0.001), 5)
    0.0123
    """
    reach = round(LONGEST_DELAY / sample_time)
    n = len(reference)
    if n <= 4 * reach:
        return math.nan
    wanted = reference[reach : n - reach] - np.mean(reference[reach : n - reach])
    windows = np.lib.stride_tricks.sliding_window_view(position - np.mean(position), n - 2 * reach)
    windows = windows - windows.mean(axis=1, keepdims=True)
    size = np.linalg.norm(windows, axis=1)
    if not size.min() > 0.0 or not np.any(wanted):
        return math.nan
    likeness = windows @ wanted / size
    peak = int(np.argmax(likeness))
    if peak in (0, 2 * reach):
        return (peak - reach) * sample_time
    left, middle, right = likeness[peak - 1 : peak + 2]
    curvature = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
    return float((peak - reach + shift) * sample_time)


def peak_error(reference: Array, truth: Array) -> Array:
    """J3, largest |error| over largest |reference|, column by column [-].

    >>> peak_error(np.array([[2.0], [-1.0]]), np.array([[2.1], [-1.3]])).round(6).tolist()
    [0.15]
    """
    found: Array = np.max(np.abs(truth - reference), axis=0) / np.max(np.abs(reference), axis=0)
    return found


def distortion(acceleration: Array, frequency: float, sample_time: float) -> float:
    """THD of the acceleration over whole periods of a sine [-], orders to 25; NaN where there is no fundamental."""
    time = np.arange(len(acceleration)) * sample_time
    found = harmonics(time, acceleration, frequency, ORDERS)
    return found.thd if found.amplitude[0] > 0.0 else math.nan


def judge(run: ClosedLoop, part: Judged, limit: float, stroke: float) -> Metrics:
    """The figures of a run.

    Parameters
    ----------
    part : what of the reference counts.
    limit : of the command [-].
    stroke : of the table [m].
    """
    largest = float(np.nanmax(np.abs(run.truth[:, 0]), initial=0.0))
    if not (np.isfinite(run.truth).all() and np.isfinite(run.command).all()):
        return Metrics(largest_position=largest, end_stop=largest >= 0.5 * stroke, unstable=True)
    wanted, found = run.reference[part.first : part.last], run.truth[part.first : part.last]
    position, velocity, acceleration = normalised_error(wanted, found).tolist()
    peaks = peak_error(wanted[:, :2], found[:, :2]).tolist()
    ratio = spectrum_of(found[:, 2], run.sample_time) / part.spectrum - 1.0
    at_rest = run.truth[part.rest :, 2]
    size = float(np.sqrt(np.mean(wanted[:, 2] ** 2)))
    moving = float(np.sqrt(np.mean(at_rest**2))) if len(at_rest) else 0.0
    return Metrics(
        delay=tracking_delay(wanted[:, 0], found[:, 0], run.sample_time),
        position_error=position,
        velocity_error=velocity,
        acceleration_error=acceleration,
        position_peak_error=peaks[0],
        velocity_peak_error=peaks[1],
        spectrum_error=float(np.sqrt(np.mean(ratio**2))),
        spectrum_largest_error=float(np.max(np.abs(ratio))),
        thd=distortion(found[:, 2], part.frequency, run.sample_time) if part.frequency > 0.0 else math.nan,
        command_travel=command_travel(run),
        time_at_limit=float(np.mean(np.abs(run.command) >= AT_LIMIT * limit)),
        largest_position=largest,
        end_stop=largest >= 0.5 * stroke,
        unstable=position >= LOST_TRACKING or moving >= STILL_MOVING * size,
    )


@dataclass(frozen=True)
class Outcome:
    """One run of a comparison.

    `load` [kg]; `table` is the number of the perturbed table, −1 for the declared one.
    """

    entry: str
    reference: str
    load: float
    table: int
    metrics: Metrics


@dataclass(frozen=True)
class Summary:
    """An entry of a comparison over its runs: mean and worst on the declared tables, and what the others did to it.

    Figures are over the runs that were not lost; `unstable` and `end_stops` count runs of both kinds of table.
    """

    entry: str
    mean: Metrics
    worst: Metrics
    perturbed_worst: Metrics
    unstable: int
    end_stops: int


def over(outcomes: Sequence[Outcome], collect: Callable[[list[float]], float]) -> Metrics:
    """Each figure collected over runs; NaN where no run has it."""
    values = {}
    for field in dataclasses.fields(Metrics):
        found = [float(getattr(o.metrics, field.name)) for o in outcomes]
        finite = [value for value in found if math.isfinite(value)]
        values[field.name] = collect(finite) if finite else math.nan
    return Metrics(**values)  # type: ignore[arg-type]


def summarise(outcomes: Sequence[Outcome]) -> list[Summary]:
    """One summary for each entry, in the order of their first runs."""
    result = []
    for entry in dict.fromkeys(o.entry for o in outcomes):
        own = [o for o in outcomes if o.entry == entry]
        declared = [o for o in own if o.table < 0]
        others = [o for o in own if o.table >= 0]
        unstable = sum(o.metrics.unstable for o in own)
        stops = sum(o.metrics.end_stop for o in own)
        result.append(Summary(entry, over(declared, fmean), over(declared, max), over(others, max), unstable, stops))
    return result


def by_load(outcomes: Sequence[Outcome], entry: str, figure: str) -> dict[float, float]:
    """Mean of one figure over the references on the declared tables, by load [kg]."""
    own = [o for o in outcomes if o.entry == entry and o.table < 0]
    loads = sorted({o.load for o in own})
    return {load: float(getattr(over([o for o in own if o.load == load], fmean), figure)) for load in loads}
