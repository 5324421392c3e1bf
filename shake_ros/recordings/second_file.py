"""Signals of a second file, recorded on a clock of its own, on the stamps of the first file.

The two clocks are compared by one motion that a sensor of each file has seen:

    t₁ = (t₂ − b₂)(1 + ε) + b₁ + δ

The acceleration in one file is the second derivative of the position in the other; b are the times of their first
samples. Both go through one band; δ is where they are most alike over all lags, then δ and ε are of least squares. A
periodic motion, such as a sine, looks alike a period later: then the result is ambiguous. A delay of the
accelerometer's filter is part of δ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.optimize import least_squares
from scipy.signal import butter, correlate, sosfiltfilt

from shake_ros.quantities import ShakeError

Floats = NDArray[np.float64]
Curve = Callable[[Floats], Floats]
LOWEST, HIGHEST = 1.0, 15.0  # band that is compared [Hz]
OF_RATE = 0.25  # of the slower rate, above which nothing is compared
FINE = 12.0  # samples of the comparison in a period of its highest frequency
OVERLAP = 5.0  # of both files, at least [s]
ALIKE = 0.6  # correlation from which two sensors recorded the same motion
APART = 0.85  # correlation elsewhere, in parts of the best, from which the time is ambiguous
FIRST_SPAN = 30.0  # over which the first fit is made, then over twice as much again and again [s]
SETTLED = 1.0  # at either end, where the band's filter has not [s]
DRIFT = 1e-3  # of a clock at most [-]


@dataclass(frozen=True)
class EvenSamples:
    """A signal of even samples. begin : time of the first on its own clock [s]. values : shape (n,)."""

    begin: float
    sample_time: float
    values: Floats

    @property
    def time(self) -> Floats:
        """(n,) on its own clock [s]."""
        return np.asarray(self.begin + self.sample_time * np.arange(len(self.values)))

    def band(self, low: float, high: float) -> Floats:
        """The part between two frequencies [Hz], without phase."""
        sections = butter(2, [low, high], "bandpass", fs=1.0 / self.sample_time, output="sos")
        return np.asarray(sosfiltfilt(sections, self.values - np.mean(self.values)))


@dataclass(frozen=True)
class Clock:
    """The second clock on the first."""

    begins: tuple[float, float]  # of both files, on their own clocks [s]
    shift: float  # of the second file's begin after the first's [s]
    drift: float  # ε [-]
    shift_deviation: float
    drift_deviation: float
    correlation: float  # of what both have seen
    turned: bool  # opposite signs

    def on_first(self, time: Floats) -> Floats:
        """Times of the second clock on the first."""
        first, second = self.begins
        return np.asarray((time - second) * (1.0 + self.drift) + first + self.shift)


def clock_of(position: EvenSamples, acceleration: EvenSamples) -> Clock:
    """The clock of an acceleration on that of a position.

    Raises
    ------
    ShakeError : the correlation is ambiguous.
    """
    high = min(HIGHEST, OF_RATE / max(position.sample_time, acceleration.sample_time))
    if high < 2.0 * LOWEST:
        raise ShakeError(f"sampled too slowly to be compared (up to {high:.2g} Hz)")
    seen = make_interp_spline(position.time - position.begin, position.band(LOWEST, high), k=5).derivative(2)
    felt = make_interp_spline(acceleration.time - acceleration.begin, acceleration.band(LOWEST, high), k=3)
    lengths = [(len(s.values) - 1) * s.sample_time for s in (position, acceleration)]
    step = 1.0 / (FINE * high)
    grids = [np.arange(0.0, length, step) for length in lengths]
    lag, turned = _lag(seen(grids[0]), felt(grids[1]), step)
    (shift, drift), deviations, left = _fitted(seen, felt, lengths, step, lag)
    begins = position.begin, acceleration.begin
    return Clock(begins, shift, drift, deviations[0], deviations[1], float(np.sqrt(1.0 - left)), turned)


def _lag(seen: Floats, felt: Floats, step: float) -> tuple[float, bool]:
    """Time by which the second signal begins after the first [s], and whether it has the other sign."""
    count = np.ones(len(seen)), np.ones(len(felt))
    cross = correlate(seen, felt)
    power = np.maximum(correlate(seen**2, count[1]), 0.0) * np.maximum(correlate(count[0], felt**2), 0.0)
    common = np.rint(correlate(count[0], count[1]))
    enough = common * step >= min(OVERLAP, 0.5 * min(len(seen), len(felt)) * step)
    least = 1e-3 * float(np.sum(seen**2) * np.sum(felt**2))
    alike = np.where(enough & (power > least), cross / np.sqrt(np.maximum(power, least)), 0.0)
    best = int(np.argmax(np.abs(alike)))
    peak = float(abs(alike[best]))
    if peak < ALIKE:
        raise ShakeError(f"the two did not record the same motion (correlation {peak:.2f} at best)")
    sign = alike * np.sign(alike[best]) > 0.0
    left = best - int(np.argmin(sign[: best + 1][::-1])) if not sign[: best + 1].all() else 0
    right = best + int(np.argmin(sign[best:])) if not sign[best:].all() else len(alike)
    others = np.abs(alike).copy()
    others[left:right] = 0.0
    second = int(np.argmax(others))
    if others[second] > APART * peak:
        apart = abs(second - best) * step
        raise ShakeError(
            f"the correlation is ambiguous: {peak:.2f} at best, {others[second]:.2f} at {apart:.3g} s "
            "from there; a periodic motion looks alike a period later"
        )
    return (best - (len(felt) - 1)) * step, bool(alike[best] < 0.0)


def _fitted(seen: Curve, felt: Curve, lengths: list[float], step: float, lag: float) -> tuple[Floats, Floats, float]:
    """Shift [s] and drift [-] of least squares, their deviations, and the mean square that they leave, in parts.

    Where both are there and their filters have settled: over a part in the midst first, then over more of it.
    """

    def residuals(x: Floats, time: Floats) -> Floats:
        """What the first signal leaves of the second one beside a gain, in parts of its size."""
        at = time * (1.0 + x[1]) + x[0]
        inside = (at >= 0.0) & (at <= lengths[0])
        a, b = np.where(inside, seen(np.clip(at, 0.0, lengths[0])), 0.0), felt(time) * inside
        size = float(np.sqrt(b @ b))
        return np.asarray((b - a * (a @ b) / max(float(a @ a), 1e-300)) / max(size, 1e-300))

    first, last = max(0.0, -lag), min(lengths[1], lengths[0] - lag)
    edge = min(SETTLED, 0.15 * (last - first))
    first, last = first + edge, last - edge
    middle, span, x = 0.5 * (first + last), FIRST_SPAN, np.array([lag, 0.0])
    while True:
        low, high = max(first, middle - 0.5 * span), min(last, middle + 0.5 * span)
        time = np.arange(low, high, step)
        scale = np.array([step, step / max(high - low, 1.0)])
        bounds = np.array([x[0] - 1.0, -DRIFT]), np.array([x[0] + 1.0, DRIFT])
        found = least_squares(residuals, x, bounds=bounds, x_scale=scale, args=(time,), diff_step=1e-6)
        x = found.x
        if span >= last - first:
            break
        span *= 2.0
    left = float(found.fun @ found.fun)
    variance = left / len(time) * FINE / 2.0  # FINE / 2 samples tell as much as one of white noise
    return x, np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac) * variance)), min(left, 1.0)


FASTER = 1.5  # times as fast as the first file, from which a second one is filtered before it is thinned
PASSED = 0.4  # of the first file's rate, up to which it passes
LOST = 1.5  # periods between two rows from which samples are missing there


def even(time: Floats, values: Floats) -> EvenSamples:
    """A signal on even samples: as it is where its stamps are even, otherwise on a line between its neighbours."""
    known = np.isfinite(values)
    count = round((time[-1] - time[0]) / float(np.median(np.diff(time)))) + 1
    step = float(time[-1] - time[0]) / (count - 1)
    return EvenSamples(float(time[0]), step, np.interp(time[0] + step * np.arange(count), time[known], values[known]))


def clock_between(first: dict[str, Floats], second: dict[str, Floats], names: tuple[Path, Path]) -> Clock:
    """The second file's clock on the first's, from the position in this and the acceleration in that one.

    Raises
    ------
    ShakeError : one line, where the correlation is ambiguous.
    """
    try:
        return clock_of(even(first["time"], first["position"]), even(second["time"], second["acceleration"]))
    except ShakeError as error:
        raise ShakeError(
            f"{names[1]}: its acceleration does not relate its clock to that of {names[0]}: {error}"
        ) from None


def brought(first: dict[str, Floats], second: dict[str, Floats], clock: Clock | None) -> dict[str, Floats]:
    """The columns of the first file while the second one ran, with the second one's signals on its stamps.

    clock : of the second file; None where both count the same time. What is sampled much faster is filtered before.
    """
    time = second["time"] if clock is None else clock.on_first(second["time"])
    common = (first["time"] >= time[0]) & (first["time"] <= time[-1])
    together = {name: column[common] for name, column in first.items()}
    if np.count_nonzero(common) < 2:
        return together
    period, of_first = float(np.median(np.diff(time))), float(np.median(np.diff(first["time"])))
    after = np.clip(np.searchsorted(time, together["time"]), 1, len(time) - 1)
    lost = time[after] - time[after - 1] > LOST * period
    for name in second.keys() - {"time"}:
        known = np.isfinite(second[name])
        values = second[name][known]
        if of_first > FASTER * period and len(values) > 30:
            values = sosfiltfilt(butter(4, PASSED * 2.0 * period / of_first, output="sos"), values)
        column = np.asarray(CubicSpline(time[known], values)(together["time"]))
        unknown = ~(known[after] & known[after - 1])
        together[name] = np.where(lost | unknown, np.nan, column)
    return together


def clock_line(clock: Clock, names: tuple[Path, Path]) -> str:
    """What was found of the second file's clock."""
    when = "after" if clock.shift >= 0.0 else "before"
    speed = "fast" if clock.drift < 0.0 else "slow"
    turned = "; the two have opposite signs" if clock.turned else ""
    return (
        f"{names[1].name}: begins {abs(clock.shift):.5f} s {when} {names[0].name} (± {1e3 * clock.shift_deviation:.2g} "
        f"ms), its clock is {1e6 * abs(clock.drift):.1f} ppm {speed} (± {1e6 * clock.drift_deviation:.2g}), found by "
        f"correlation ({clock.correlation:.3f}); this includes a delay of the accelerometer{turned}"
    )
