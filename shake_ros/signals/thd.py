"""Harmonics of a periodic signal and their total harmonic distortion, THD = sqrt(Σ A_k², k ≥ 2) / A_1 (6.1).

The signal is fitted by least squares with y(t) = c + Σ_k [a_k cos kωt + b_k sin kωt], so sampling need not be
coherent with the fundamental nor the sample times equally spaced; an unknown ω is a parameter of the same fit.
The sums of the normal equations need only Σ exp(imωt), m ≤ 2K (products of cosines are sums of cosines), so the cost
grows as samples × orders.

Range: at least one whole period (unknown fundamental: two), more samples than twice the parameters.
Verified against closed forms (square, triangle, sums of known harmonics) and tables 6.1 and 6.2.
Source: thesis, section 6.2; section 9 of the equation sheet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shake_ros.quantities import ShakeError

Floats = npt.NDArray[np.float64]
REFINING_ORDERS = 16  # harmonics that help to find the fundamental; more no longer sharpen it
REFINING_STEPS = 20
CLOCKS = 0.01  # by which two clocks may differ, of a frequency
COMPARED_ORDERS = 8  # harmonics whose power is compared within that
NYQUIST_MARGIN = 1e-6
QUARTILE = 0.25


@dataclass(frozen=True)
class Harmonics:
    """Harmonics of a signal y(t) = offset + Σ_k amplitude_k · sin(2π k f t + phase_k) + rest."""

    frequency: float  # the fundamental f [Hz]
    amplitude: Floats  # (K,) of orders 1 … K [unit of the signal]
    phase: Floats  # (K,) at time 0 of the given times [rad], in (−π, π]
    offset: float  # mean of the signal [unit of the signal]
    # standard deviation of white noise that has the lower quartile of the rest's spectrum, which lines between the
    # harmonics hardly raise [unit]
    floor: float
    rest: float  # root mean square of what the K harmonics leave, noise and lines in between [unit]
    # samples, periods, start, stop: the window: number of samples, periods in it, first and last time [s]
    samples: int
    periods: float
    start: float
    stop: float

    @property
    def orders(self) -> npt.NDArray[np.int64]:
        """1 … K."""
        return np.arange(1, len(self.amplitude) + 1)

    @property
    def amplitude_error(self) -> float:
        """Standard deviation of an amplitude by the noise floor [unit of the signal]: σ sqrt(2/N)."""
        return self.floor * math.sqrt(2.0 / self.samples)

    @property
    def thd(self) -> float:
        """THD (6.1) of orders 2 … K [-]; what the noise adds to the squares of the amplitudes is taken off."""
        bias = 2.0 * self.amplitude_error**2 * (len(self.amplitude) - 1)
        return math.sqrt(max(float(np.sum(self.amplitude[1:] ** 2)) - bias, 0.0)) / float(self.amplitude[0])

    @property
    def thd_and_noise(self) -> float:
        """All that is not the fundamental over the fundamental [-]: harmonics, what lies between them, and noise.

        Against `thd` this has orders above K too, among them those that sampling folds back below half its rate.
        """
        others = float(np.sum(self.amplitude[1:] ** 2)) + 2.0 * self.rest**2
        return math.sqrt(others) / float(self.amplitude[0])

    @property
    def noise(self) -> float:
        """Root mean square of all that is in no harmonic [unit]: what is between `thd` and `thd_and_noise`."""
        return float(self.amplitude[0]) * math.sqrt(0.5 * max(self.thd_and_noise**2 - self.thd**2, 0.0))


def total_harmonic_distortion(amplitudes: npt.ArrayLike) -> float:
    """(6.1): root of the summed squares of all amplitudes behind the first, over the first [-].

    The print's "× 1000/0" means × 100 %.

    >>> round(total_harmonic_distortion([2.35, 0.24, 0.29, 0.67, 0.81, 0.26, 0.20]), 3)
    0.495
    """
    A = np.asarray(amplitudes, dtype=np.float64)
    if A.ndim != 1 or len(A) < 1 or not np.isfinite(A).all() or A[0] <= 0.0:
        raise ShakeError("THD needs finite amplitudes, the first of them positive")
    # (6.1)
    return float(np.sqrt(np.sum(A[1:] ** 2)) / A[0])


def harmonics(
    time: npt.ArrayLike, signal: npt.ArrayLike, frequency: float | None = None, orders: int | None = None
) -> Harmonics:
    """Harmonic amplitudes and phases over the newest whole periods of a signal.

    Parameters
    ----------
    time, signal : (n,) [s], [unit]; finite, time ascending, equally spaced but for jitter.
    frequency : fundamental [Hz]; None finds it: the strongest line, then refined with all harmonics up to 16.
    orders : harmonics to fit; None takes all below half the sampling rate, at most a quarter of the samples.

    Raises
    ------
    ShakeError
        where the signal is not finite, is constant, or is shorter than a whole period of the fundamental.

    >>> t = np.arange(1000) * 0.001
    >>> found = harmonics(t, np.sin(2 * np.pi * 5.0 * t) + 0.1 * np.sin(2 * np.pi * 15.0 * t), 5.0)
    >>> round(found.thd, 6)
    0.1
    """
    t, y = _checked(time, signal)
    if frequency is None:
        frequency = fundamental_frequency(t, y)
    window = newest_periods(t, frequency)
    t, y = t[window], y[window]
    K = _orders(t, frequency, orders)
    middle = 0.5 * (t[0] + t[-1])
    _, coefficients, rest = _fit(t - middle, y, np.ones_like(y), frequency, K)
    a, b = coefficients[1 : K + 1], coefficients[K + 1 :]
    k = np.arange(1, K + 1)
    phase = np.arctan2(a, b) - 2.0 * np.pi * frequency * k * middle
    freedom = max(len(t) - 2 * K - 1, 1)
    floor = _floor(rest) * math.sqrt(len(t) / freedom)
    return Harmonics(
        frequency=float(frequency),
        amplitude=np.hypot(a, b),
        phase=np.pi - np.mod(np.pi - phase, 2.0 * np.pi),
        offset=float(coefficients[0]),
        floor=floor,
        rest=float(np.sqrt(np.mean(rest**2))),
        samples=len(t),
        periods=(t[-1] - t[0]) * len(t) / (len(t) - 1) * frequency,
        start=float(t[0]),
        stop=float(t[-1]),
    )


def newest_periods(time: Floats, frequency: float, periods: int | None = None) -> slice:
    """The newest whole periods, to the nearest sample: as many as fit, or `periods` of them.

    Raises ShakeError where there are fewer.

    >>> newest_periods(np.arange(1000) * 0.001, 3.0, 2)
    slice(333, 1000, None)
    """
    if not (math.isfinite(frequency) and frequency > 0.0):
        raise ShakeError(f"frequency = {frequency:g} Hz is not positive")
    n = len(time)
    step = float(time[-1] - time[0]) / (n - 1)
    fitting = math.floor((n + 0.5) * step * frequency)
    wanted = fitting if periods is None else periods
    if not 1 <= wanted <= fitting:
        raise ShakeError(f"{n * step:.3g} s hold {fitting} whole periods of {frequency:.4g} Hz, needs {max(wanted, 1)}")
    return slice(max(n - round(wanted / (frequency * step)), 0), n)


def fundamental_frequency(time: npt.ArrayLike, signal: npt.ArrayLike, near: float | None = None) -> float:
    """The fundamental of a periodic signal [Hz], by least squares in frequency and harmonics together.

    Parameters
    ----------
    time, signal : (n,) [s], [unit].
    near : where to start [Hz], within about 1/(2 × duration); None starts at the strongest line of the spectrum.

    Raises
    ------
    ShakeError
        where the signal is constant or holds less than two periods.
    """
    t, y = _checked(time, signal)
    step = (t[-1] - t[0]) / (len(t) - 1)
    f = _strongest_line(y, step) if near is None else near
    if f * (t[-1] - t[0] + step) < 1.9:
        raise ShakeError(f"{t[-1] - t[0]:.3g} s contain less than two periods: the fundamental cannot be found")
    centred = t - 0.5 * (t[0] + t[-1])
    largest = _orders(t, f, REFINING_ORDERS)
    K = 1
    while True:
        f = _refined(centred, y, f, K)
        if K >= largest:
            return f
        K = min(2 * K, largest)


def nearby_fundamental(time: npt.ArrayLike, signal: npt.ArrayLike, near: float) -> float:
    """The fundamental of a signal near that of its excitation, which another clock may have measured [Hz].

    Where two periods are there: from the frequency within 1 % and two lines whose harmonics hold the most power,
    refined as by `fundamental_frequency`. `near` itself otherwise, and where the harmonics fit no better elsewhere.

    >>> t = np.arange(60000) * 0.001
    >>> round(nearby_fundamental(t, np.sin(2 * np.pi * 5.003 * t), 5.0), 6)
    5.003
    """
    t, y = _checked(time, signal)
    length = (t[-1] - t[0]) * len(t) / (len(t) - 1)
    if not near * length > 1.9:
        return near
    reach = min(CLOCKS * near + 2.0 / length, 0.4 * near)
    apart = np.arange(0.0, reach, 1.0 / (COMPARED_ORDERS * length))
    tried = near + np.concatenate((-apart[:0:-1], apart))
    size = 4 * 2 ** math.ceil(math.log2(len(t)))
    power = np.abs(np.fft.rfft((y - y.mean()) * np.hanning(len(y)), size)) ** 2
    orders = np.arange(1, _orders(t, float(tried[-1]), COMPARED_ORDERS) + 1)
    places = np.rint(np.outer(orders, tried) * size * length / len(t)).astype(int)
    best = float(tried[int(np.argmax(np.sum(power[np.minimum(places, len(power) - 1)], axis=0)))])
    found = fundamental_frequency(t, y, near=best)
    left = [harmonics(t, y, f, REFINING_ORDERS).rest for f in (found, near)]
    return found if left[0] < left[1] else near


def _checked(time: npt.ArrayLike, signal: npt.ArrayLike) -> tuple[Floats, Floats]:
    t, y = np.asarray(time, dtype=np.float64), np.asarray(signal, dtype=np.float64)
    if t.ndim != 1 or t.shape != y.shape or len(t) < 8:
        raise ShakeError(f"harmonics need rows of at least 8 times and values, got shapes {t.shape} and {y.shape}")
    if not (np.isfinite(t).all() and np.isfinite(y).all()):
        raise ShakeError("harmonics need finite times and values")
    if (np.diff(t) <= 0.0).any():
        raise ShakeError("harmonics need ascending times")
    if np.ptp(y) == 0.0:
        raise ShakeError("the signal is constant: it has no harmonics")
    return t, y


def _orders(t: Floats, frequency: float, wanted: int | None) -> int:
    n = len(t)
    nyquist = 0.5 * (n - 1) / (t[-1] - t[0])
    below = math.floor(nyquist * (1.0 - NYQUIST_MARGIN) / frequency)
    if below < 1:
        raise ShakeError(f"{frequency:.4g} Hz is not below half the sampling rate, {nyquist:.4g} Hz")
    if wanted is not None and wanted < 1:
        raise ShakeError(f"{wanted} harmonics: needs at least 1")
    return min(below, max(n // 4, 1), below if wanted is None else wanted)


def _strongest_line(y: Floats, step: float) -> float:
    """Frequency of the largest peak of the spectrum under a Hann window [Hz], by a parabola through its logarithm."""
    n = len(y)
    length = 4 * 2 ** math.ceil(math.log2(n))
    spectrum = np.abs(np.fft.rfft((y - y.mean()) * np.hanning(n), length))
    lowest = math.ceil(1.5 * length / n)  # what is slower than 1.5 periods in the window is drift
    peak = lowest + int(np.argmax(spectrum[lowest:-1]))
    left, middle, right = np.log(np.maximum(spectrum[peak - 1 : peak + 2], 1e-300))
    curvature = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
    return float((peak + min(max(shift, -0.5), 0.5)) / (length * step))


def _refined(t: Floats, y: Floats, frequency: float, K: int) -> float:
    """Gauss–Newton in the frequency, the amplitudes being eliminated (variable projection); t centred.

    The squares are weighted by a Hann window, which keeps orders above K from pulling at the frequency.
    """
    w = np.hanning(len(t) + 2)[1:-1]
    reach = 0.5 / (t[-1] - t[0])
    k = np.arange(1, K + 1)
    start = frequency
    for _ in range(REFINING_STEPS):
        gram, coefficients, rest = _fit(t, y, w, frequency, K)
        a, b = coefficients[1 : K + 1], coefficients[K + 1 :]
        slope = 2.0 * np.pi * t * _synthesis(t, frequency, k * b, -k * a)
        across = slope - _model(t, frequency, _solve(gram, _products(t, w * slope, frequency, K)))
        change = float(across @ (w * rest)) / float(across @ (w * across))
        frequency += min(max(change, -reach / 4.0), reach / 4.0)
        if abs(frequency - start) > reach:
            return start  # ran to another line: not a better place
        if abs(change) < 1e-12 * frequency:
            break
    return frequency


def _fit(t: Floats, y: Floats, w: Floats, frequency: float, K: int) -> tuple[Floats, Floats, Floats]:
    """Gram matrix of (1, cos kωt, sin kωt) under the weights w, its coefficients for y, and what they leave of y."""
    gram = _gram(t, w, frequency, K)
    coefficients = _solve(gram, _products(t, w * y, frequency, K))
    return gram, coefficients, y - _model(t, frequency, coefficients)


def _solve(gram: Floats, products: Floats) -> Floats:
    return np.asarray(np.linalg.solve(gram, products), dtype=np.float64)


def _gram(t: Floats, w: Floats, frequency: float, K: int) -> Floats:
    """Inner products of (1, cos kωt, sin kωt), k ≤ K, from the weighted sums of exp(imωt), m ≤ 2K."""
    turn = np.exp(2j * np.pi * frequency * t)
    power = w.astype(np.complex128)
    sums = np.empty(2 * K + 1, dtype=np.complex128)
    for m in range(2 * K + 1):
        sums[m] = power.sum()
        power *= turn
    k = np.arange(K + 1)
    difference, total = k[:, None] - k[None, :], k[:, None] + k[None, :]
    c, s = sums.real, sums.imag
    cos_cos = 0.5 * (c[np.abs(difference)] + c[total])
    sin_sin = 0.5 * (c[np.abs(difference)] - c[total])[1:, 1:]
    sin_cos = 0.5 * (s[total] + np.sign(difference) * s[np.abs(difference)])[1:, :]
    return np.block([[cos_cos, sin_cos.T], [sin_cos, sin_sin]])


def _products(t: Floats, y: Floats, frequency: float, K: int) -> Floats:
    """Inner products of y with (1, cos kωt, sin kωt)."""
    turn = np.exp(2j * np.pi * frequency * t)
    power = y.astype(np.complex128)
    sums = np.empty(K + 1, dtype=np.complex128)
    for k in range(K + 1):
        sums[k] = power.sum()
        power *= turn
    return np.concatenate((sums.real, sums.imag[1:]))


def _synthesis(t: Floats, frequency: float, a: Floats, b: Floats) -> Floats:
    """Σ_k a_k cos kωt + b_k sin kωt, by Horner's rule in exp(iωt)."""
    turn = np.exp(2j * np.pi * frequency * t)
    value = np.zeros_like(turn)
    for c in (a - 1j * b)[::-1]:
        value = (value + c) * turn
    return np.asarray(value.real)


def _model(t: Floats, frequency: float, coefficients: Floats) -> Floats:
    K = len(coefficients) // 2
    return coefficients[0] + _synthesis(t, frequency, coefficients[1 : K + 1], coefficients[K + 1 :])


def _floor(rest: Floats) -> float:
    """Standard deviation of white noise whose spectrum has the lower quartile of this one: lines hardly raise it."""
    w = np.blackman(len(rest))
    power = np.abs(np.fft.rfft(rest * w)[1:-1]) ** 2
    return float(math.sqrt(np.quantile(power, QUARTILE) / (-math.log1p(-QUARTILE) * np.sum(w**2))))
