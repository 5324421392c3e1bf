"""Velocity of a recording: derivative of the measured position and simulated velocity through one zero-phase filter.

Where no position was measured, it is the acceleration integrated twice. What is slower than SLOWEST drowns in bias and
drift; there the table is taken to follow its command, by the gain with which it does above. The mean of the command is
the null of its valve, in a short recording also the way that the table went: in one of CENTRED half of it is.
"""

from __future__ import annotations

import functools

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.interpolate import make_interp_spline, make_lsq_spline
from scipy.signal import butter, sosfiltfilt

CUTOFF = 40.0  # bandwidth of the velocity filter [Hz], (6.3.3.2)
ORDER = 4  # per pass; forward and backward make the thesis's 8
SLOWEST = 0.3  # motion that an acceleration shows beyond its bias and drift [Hz]
CENTRED = 10.0  # a null of 0.3 % moves a table that makes 0.6 m/s by 20 mm in this time [s]


def low_pass(values: np.ndarray, sample_time: float, cutoff: float = CUTOFF) -> np.ndarray:
    """Zero-phase Butterworth low-pass along the last axis, at 0.4 of the sampling rate at most."""
    sections = butter(ORDER, min(cutoff * 2.0 * sample_time, 0.8), output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=-1))


def with_gains(values: np.ndarray, sample_time: float, lines: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """A signal with gains at frequencies, without phase, along its last axis; mirrored at its ends.

    Parameters
    ----------
    lines : frequencies [Hz], evenly from 0 on, shape (k,). gains : at these [-], shape (k,).
    """
    count = values.shape[-1]
    beyond = min(round(1.0 / (lines[1] * sample_time)), count - 1)
    mirrored = np.pad(values, [(0, 0)] * (values.ndim - 1) + [(beyond, beyond)], mode="reflect")
    size = next_fast_len(mirrored.shape[-1], real=True)
    gain = np.interp(rfftfreq(size, sample_time), lines, gains)
    return np.asarray(irfft(gain * rfft(mirrored, size), size)[..., beyond : beyond + count])


def _beyond(samples: int, sample_time: float) -> int:
    """Samples by which a signal is continued at both ends, where the filter would settle on it."""
    return min(round(2.0 / (CUTOFF * sample_time)), samples - 1)


def filtered_velocity(velocity: np.ndarray, sample_time: float) -> np.ndarray:
    """A simulated velocity as `derivative` shows a measured one: mirrored at its ends, low-passed, (…, n) [m/s]."""
    count = velocity.shape[-1]
    beyond = _beyond(count, sample_time)
    around = [(0, 0)] * (velocity.ndim - 1) + [(beyond, beyond)]
    return low_pass(np.pad(velocity, around, mode="reflect"), sample_time)[..., beyond : beyond + count]


def derivative(position: np.ndarray, sample_time: float) -> np.ndarray:
    """Low-passed derivative of a position, shape (n,) [m] → [m/s], by a spline of fifth order through its samples.

    A central difference shows sin(ωT)/(ωT) of the velocity: at 200 Hz sampling 6 % less at 20 Hz.
    """
    beyond = _beyond(len(position), sample_time)  # the spline's end would amplify the noise
    extended = np.pad(position, beyond, mode="reflect", reflect_type="odd")
    time = sample_time * np.arange(len(extended))
    slope = make_interp_spline(time, extended, k=min(5, len(extended) - 1)).derivative()(time)
    return low_pass(slope, sample_time)[beyond : beyond + len(position)]


def integrated(acceleration: np.ndarray, command: np.ndarray, sample_time: float) -> np.ndarray:
    """Position from acceleration [m/s²] and valve command [-], about its mean, all of shape (n,) [m].

    >>> time = 0.002 * np.arange(5000)
    >>> fast, slow = 4.0 * np.pi * time, 0.4 * np.pi * time
    >>> position = integrated(0.3 - 4.0 * np.sin(fast) - 0.04 * np.sin(slow), np.cos(fast) + 0.1 * np.cos(slow), 0.002)
    >>> error = position - 4.0 * np.sin(fast) / (4.0 * np.pi) ** 2 - 0.04 * np.sin(slow) / (0.4 * np.pi) ** 2
    >>> bool(np.std(error) < 1e-3)
    True
    """
    time = sample_time * np.arange(len(acceleration))
    inner = np.linspace(0.0, time[-1], max(round(2.0 * SLOWEST * time[-1]), 1) + 1)
    knots = np.concatenate([np.zeros(3), inner, np.full(3, time[-1])])
    felt = make_interp_spline(time, acceleration).antiderivative(2)(time)
    null = np.mean(command) / (1.0 + (CENTRED / time[-1]) ** 2)
    told = make_interp_spline(time, command - null, k=1).antiderivative()(time)
    slow, slow_told = (make_lsq_spline(time, values, knots)(time) for values in (felt, told))
    fast, fast_told = felt - slow, told - slow_told
    gain = float(fast_told @ fast) / max(float(fast_told @ fast_told), 1e-300)
    return np.asarray(fast + gain * (slow_told - np.mean(slow_told)))


def independent_part(sample_time: float, every: float = 1.0) -> float:
    """Part of a filtered velocity's samples that are independent, where one of `every` is taken [-]."""
    return min(2.0 * CUTOFF * sample_time * every, 1.0)


def samples_apart(sample_time: float) -> int:
    """Samples of a filtered velocity from one independent one to the next."""
    return max(round(1.0 / (2.0 * CUTOFF * sample_time)), 1)


@functools.cache
def velocity_noise_gain(sample_time: float) -> float:
    """Standard deviation of the filtered velocity per standard deviation of white noise on the position [1/s]."""
    white = np.random.default_rng(0).standard_normal(20000)
    return float(np.std(derivative(white, sample_time)[1000:-1000]))
