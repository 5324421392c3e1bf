"""The response to a periodic multisine split into linear, even and odd nonlinear parts and noise.

Over whole periods the Fourier lines of a response are multiples of 1/period. What changes from period to period is
noise; what repeats on a line that the excitation leaves out is nonlinear distortion: even orders on even lines, odd
orders on odd lines (an excitation on odd lines keeps the two apart). On the excited lines stands the best linear
approximation with odd distortion in it, whose level the omitted odd lines between them show. What little the
excitation itself has on a line left out, because a loop feeds distortion back, is taken off with its neighbours' gain.

Source: R. Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach (2012), chapters 3.7 and 4.3.
Verified against closed forms of static nonlinearities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shake_ros.quantities import ShakeError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
EXCITED = 0.02  # part of the largest line of the excitation from which on a line counts as excited
SHORTEST = 64  # samples of a period that is looked for
PERIODIC = 0.05  # relative change from period to period up to which an excitation counts as repeated
UNREPEATED = 0.3  # scatter of the periods, relative to the excitation, from which on a split makes no sense


@dataclass(frozen=True)
class MultisineSplit:
    """Lines of a response, from the first above zero to below half the sampling rate, each array of shape (n,)."""

    frequency: Floats  # [Hz]
    response: Complexes  # complex amplitude of the mean period, corrected on lines left out [its unit]
    # standard deviation of those amplitudes through noise, from the scatter of the periods; NaN for one period
    noise: Floats
    # excited, odd: which lines are excited, which are odd multiples of 1/period
    excited: NDArray[np.bool_]
    odd: NDArray[np.bool_]
    gain: Complexes  # response per excitation on excited lines, NaN elsewhere
    # amplitude of the odd distortion on each line, on excited lines interpolated from the odd lines left out beside
    # them; NaN where no odd line is left out
    odd_level: Floats
    periods: int  # number of periods used

    @property
    def separates_even_from_odd(self) -> bool:
        """Whether only odd lines are excited, so that even distortion cannot fall on odd lines."""
        return bool(not np.any(self.excited & ~self.odd))

    def parts(self) -> dict[str, float]:
        """Root mean square over a period of each part [unit of the response].

        `linear` is what the excited lines hold less odd distortion and noise, `even` and `odd` the distortions, `noise`
        the part of a sample that does not repeat. `odd` is NaN where no odd line is omitted.
        """
        variance = np.nan_to_num(self.noise**2)
        power = np.maximum(np.abs(self.response) ** 2 - variance, 0.0) / 2.0  # of a real line of this amplitude
        left_out_odd, even = self.odd & ~self.excited, ~self.odd & ~self.excited
        hidden = np.nan_to_num(self.odd_level[self.excited]) ** 2 / 2.0
        known = bool(np.any(np.isfinite(self.odd_level)))
        odd = float(np.sum(power[left_out_odd]) + np.sum(hidden)) if known else np.nan
        linear = max(float(np.sum(power[self.excited]) - np.sum(hidden)), 0.0)
        noise = float(np.sum(self.noise**2)) / 2.0 * self.periods
        rms = np.sqrt([linear, float(np.sum(power[even])), odd, noise])
        return dict(zip(("linear", "even", "odd", "noise"), rms.tolist(), strict=True))


def whole_periods(signal: ArrayLike, samples: int, skip: int | None = None) -> Floats:
    """A record cut into whole periods from its end, shape (periods, samples).

    Parameters
    ----------
    signal : shape (n,).
    samples : per period.
    skip : periods left out at the start, in which the table still settles; one where at least two remain, if not given.

    Raises
    ------
    ShakeError : not a whole period, or a value that is not finite.
    """
    values = np.asarray(signal, dtype=np.float64)
    count = len(values) // samples if samples > 0 else 0
    first = (1 if count > 2 else 0) if skip is None else skip
    if samples < 4 or count - first < 1:
        raise ShakeError(f"{len(values)} samples contain no whole period of {samples} behind {first} left out")
    if not np.isfinite(values).all():
        raise ShakeError(f"sample {int(np.argmin(np.isfinite(values)))} is not a finite number")
    kept = count - first
    return values[len(values) - kept * samples :].reshape(kept, samples)


def noise_from_periods(signal: ArrayLike, samples: int) -> float:
    """Standard deviation of what does not repeat from period to period [unit of the signal].

    A straight line through each period's difference from the mean period is drift, not noise.

    Parameters
    ----------
    signal : shape (n,), at least two whole periods of `samples` behind the first, see `whole_periods`.

    >>> rng = np.random.default_rng(1)
    >>> wave = np.tile(np.sin(2 * np.pi * np.arange(1000) / 1000), 4)
    >>> abs(noise_from_periods(wave + 0.1 * rng.standard_normal(4000), 1000) / 0.1 - 1.0) < 0.03
    True
    """
    rows = whole_periods(signal, samples)
    if len(rows) < 2:
        raise ShakeError(f"{len(rows)} period of {samples} samples: noise needs two")
    rest = rows - rows.mean(axis=0)
    axis = np.linspace(-1.0, 1.0, samples)
    rest -= rest.mean(axis=1, keepdims=True) + np.outer(rest @ axis / (axis @ axis), axis)
    freedom = (len(rows) - 1) * (samples - 2)
    return float(np.sqrt(np.sum(rest**2) / freedom))


def repeated_period(excitation: ArrayLike, change: float = PERIODIC) -> int | None:
    """Samples after which an excitation repeats itself to the end of its record, or None.

    Parameters
    ----------
    excitation : shape (n,).
    change : from period to period, relative to the excitation, up to which it repeats.

    >>> rng = np.random.default_rng(1)
    >>> repeated_period(np.tile(rng.standard_normal(500), 3)), repeated_period(rng.standard_normal(1500))
    (500, None)
    """
    u = np.asarray(excitation, dtype=np.float64)
    u = u - u.mean()
    n = len(u)
    if n < 2 * SHORTEST or not np.isfinite(u).all() or not np.any(u):
        return None
    lags = np.arange(SHORTEST, n // 2 + 1)
    product = np.fft.irfft(np.abs(np.fft.rfft(u, 2 * n)) ** 2)[lags]
    squares = np.concatenate(([0.0], np.cumsum(u**2)))
    size = squares[n - lags] + (squares[n] - squares[lags])
    changed = np.sqrt(np.maximum(size - 2.0 * product, 0.0) / np.maximum(size, 1e-300) * 2.0)
    good = np.flatnonzero(changed < change)
    if not len(good):
        return None
    valley = good[: np.argmax(np.append(np.diff(good) > 1, True)) + 1]  # the first run of neighbouring lags
    return int(lags[valley[np.argmin(changed[valley])]])


def multisine_split(
    excitation: ArrayLike, response: ArrayLike, samples: int, sample_time: float, skip: int | None = None
) -> MultisineSplit:
    """Split a response to a repeated multisine.

    Parameters
    ----------
    excitation, response : shape (n,), of one record.
    samples : per period.
    sample_time : [s].
    skip : periods left out at the start; one where at least two remain, if not given.

    Raises
    ------
    ShakeError : no whole period, an excitation that does not repeat itself, or none at all.
    """
    u, y = whole_periods(excitation, samples, skip), whole_periods(response, samples, skip)
    changing, size = float(np.std(u - u.mean(axis=0))), float(np.std(u))
    if changing > UNREPEATED * size or size == 0.0:
        what = "is constant" if size == 0.0 else f"does not repeat itself after {samples} samples"
        raise ShakeError(f"the excitation {what}")
    number = np.arange(1, (samples + 1) // 2)
    u_lines = np.fft.rfft(u, axis=1)[:, number].mean(axis=0) * 2.0 / samples
    all_lines = np.fft.rfft(y, axis=1)[:, number] * 2.0 / samples
    mean, count = all_lines.mean(axis=0), len(y)
    scatter = np.full(len(number), np.nan)
    if count > 1:
        scatter = np.sqrt(np.sum(np.abs(all_lines - mean) ** 2, axis=0) / (count * (count - 1)))
    lines = np.abs(u_lines)
    excited = np.asarray(lines > EXCITED * lines.max())
    odd = np.asarray(number % 2 == 1)
    gain = np.full(len(number), np.nan + 0j)
    gain[excited] = mean[excited] / u_lines[excited]
    corrected = mean - np.where(excited, 0.0, _neighbouring_gain(number, excited, gain) * u_lines)
    level = _odd_level(number, corrected, scatter, excited, odd)
    return MultisineSplit(number / (samples * sample_time), corrected, scatter, excited, odd, gain, level, count)


def _neighbouring_gain(number: NDArray[np.int64], excited: NDArray[np.bool_], gain: Complexes) -> Complexes:
    """Gain interpolated between excited lines, zero outside their band, shape (n,)."""
    at = number[excited]
    real = np.interp(number, at, gain[excited].real, left=0.0, right=0.0)
    imaginary = np.interp(number, at, gain[excited].imag, left=0.0, right=0.0)
    return np.asarray(real + 1j * imaginary)


def _odd_level(
    number: NDArray[np.int64], response: Complexes, noise: Floats, excited: NDArray[np.bool_], odd: NDArray[np.bool_]
) -> Floats:
    """Amplitude of odd distortion on each line: measured on odd lines left out, interpolated in power between."""
    band = (number >= number[excited].min()) & (number <= number[excited].max())
    telling = odd & ~excited
    if not np.any(telling & band):
        return np.full(len(number), np.nan)
    power = np.maximum(np.abs(response) ** 2 - np.nan_to_num(noise) ** 2, 0.0)
    level = np.sqrt(np.interp(number, number[telling], power[telling]))
    level[~odd] = np.nan
    return np.asarray(level)
