"""From a recorded acceleration to a motion that a table can make: baseline, band, integration.

Method: the mean is removed, the ends are tapered, and a Butterworth filter of order 4 is run forwards and backwards
(no phase shift) over the record between long stretches of rest. The displacement is then faded in and out over the
pads before and after the record, with the derivatives of the fade, and what remains of velocity and displacement at
the end (rounding, mostly) is taken out with two smooth polynomials over the whole length. Between samples the
acceleration is linear, and its integrals are exact for that.
See D. M. Boore and J. J. Bommer, Soil Dynamics and Earthquake Engineering 25 (2005), 93–115, on padding and filters.
"""

from __future__ import annotations

import numpy as np

from shake_ros.control.reference.motion import LONGEST, Array, product, smooth_step
from shake_ros.quantities import ShakeError

TAPER = 0.02
"""Share of the accelerogram at each end under the cosine taper."""
GUARD = 3.0
"""Rest on both sides while filtering, beyond the pads, in periods of the high-pass corner."""


def integrate(acceleration: Array, time_step: float) -> tuple[Array, Array]:
    """Velocity [m/s] and displacement [m] from rest of an acceleration that is linear between samples; exact.

    >>> velocity, displacement = integrate(np.array([0.0, 6.0, 12.0]), 1.0)   # a = 6 t
    >>> velocity.tolist(), displacement.tolist()
    ([0.0, 3.0, 12.0], [0.0, 1.0, 8.0])
    """
    a, h = np.asarray(acceleration, dtype=np.float64), time_step
    velocity = np.concatenate(([0.0], np.cumsum(h * (a[:-1] + a[1:]) / 2.0)))
    displacement = np.concatenate(([0.0], np.cumsum(h * velocity[:-1] + h**2 * (2.0 * a[:-1] + a[1:]) / 6.0)))
    return velocity, displacement


def states_from_rest(acceleration: Array, time_step: float) -> Array:
    """(n, 3) displacement, velocity, acceleration from rest, as `integrate` has them."""
    velocity, displacement = integrate(acceleration, time_step)
    return np.column_stack([displacement, velocity, acceleration])


def _tapered(acceleration: Array) -> Array:
    """The record less its mean, its ends under half a cosine."""
    centred = acceleration - np.mean(acceleration)
    length = max(2, round(TAPER * centred.size))
    flank = 0.5 - 0.5 * np.cos(np.pi * np.arange(length) / length)
    centred[:length] *= flank
    centred[-length:] *= flank[::-1]
    return np.asarray(centred, dtype=np.float64)


def filtered(acceleration: Array, time_step: float, high_pass: float, low_pass: float) -> Array:
    """The acceleration within high_pass … low_pass [Hz], without phase shift; 0 = no such bound.

    Raises ShakeError where the band is empty or beyond half the sampling rate.
    """
    from scipy.signal import butter, sosfiltfilt  # takes longest to import of all, and only records need it

    nyquist = 0.5 / time_step
    if high_pass >= nyquist or (low_pass > 0.0 and high_pass >= low_pass):
        raise ShakeError(
            f"high_pass = {high_pass:g} Hz leaves nothing below low_pass = {low_pass:g} Hz and {nyquist:g} Hz"
        )
    result = acceleration
    if high_pass > 0.0:
        result = sosfiltfilt(butter(4, high_pass / nyquist, "highpass", output="sos"), result, padtype=None)
    if 0.0 < low_pass < nyquist:
        result = sosfiltfilt(butter(4, low_pass / nyquist, "lowpass", output="sos"), result, padtype=None)
    return np.asarray(result, dtype=np.float64)


def end_at_rest(acceleration: Array, time_step: float) -> Array:
    """The acceleration less a smooth correction after which velocity and displacement end at zero.

    The correction is w (c_0 + c_1 (τ − 1/2)) with w = 16 τ² (1 − τ)², τ from 0 to 1 over the length.
    """
    tau = np.linspace(0.0, 1.0, acceleration.size)
    weight = 16.0 * tau**2 * (1.0 - tau) ** 2
    shapes = (weight, weight * (tau - 0.5))
    corrected = acceleration
    for _ in range(2):  # the second pass takes out the rounding of the first
        ends = np.array([[part[-1] for part in integrate(shape, time_step)] for shape in shapes]).T
        target = np.array([part[-1] for part in integrate(corrected, time_step)])
        c = np.linalg.solve(ends, target)
        corrected = corrected - c[0] * shapes[0] - c[1] * shapes[1]
    return corrected


def correct_baseline(
    acceleration: Array, time_step: float, high_pass: float, low_pass: float, pad_time: float
) -> Array:
    """Acceleration [m/s²] that starts and ends at rest at zero displacement.

    Parameters
    ----------
    acceleration : (m,) [m/s²], uniform in time; not changed.
    time_step : [s].
    high_pass, low_pass : band [Hz]; 0 = no bound.
    pad_time : rest put before and after [s].

    Returns
    -------
    (m + 2 pad_time/time_step,) [m/s²]
    """
    pad = max(2, round(pad_time / time_step))
    guard = pad + (round(GUARD / (high_pass * time_step)) if high_pass > 0.0 else 0)
    if guard > LONGEST:
        raise ShakeError(f"high_pass = {high_pass:g} Hz is too low for a time step of {time_step:g} s")
    record = _tapered(np.array(acceleration, dtype=np.float64))
    band = filtered(np.pad(record, guard), time_step, high_pass, low_pass)
    if high_pass == 0.0:
        band = end_at_rest(band, time_step)
    velocity, displacement = integrate(band, time_step)
    kept = slice(guard - pad, guard + record.size + pad)
    fade = _fade(record.size + 2 * pad, pad, time_step)
    return end_at_rest(product(fade, (displacement[kept], velocity[kept], band[kept]))[:, 2], time_step)


def _fade(count: int, length: int, time_step: float) -> tuple[Array, Array, Array]:
    """A C² window of `count` samples with flanks of `length` samples, and its first two derivatives by time."""
    place = np.arange(count, dtype=np.float64)
    nearest = np.minimum(place, count - 1 - place)
    value, slope, curvature = smooth_step(nearest / length)
    sign = np.where(place < count / 2, 1.0, -1.0)
    span = length * time_step
    return value, sign * slope / span, curvature / span**2


def resample(acceleration: Array, time_step: float, sample_time: float) -> Array:
    """Rows (displacement, velocity, acceleration) at k * sample_time of an acceleration linear between samples.

    Exact at every instant, also between the record's samples; shape (n, 3), the last row at or after its end.
    """
    velocity, displacement = integrate(acceleration, time_step)
    end = (acceleration.size - 1) * time_step
    time = np.minimum(np.arange(int(np.ceil(end / sample_time - 1e-9)) + 1) * sample_time, end)
    i = np.minimum((time / time_step).astype(np.int64), acceleration.size - 2)
    s = time - i * time_step
    slope = (acceleration[i + 1] - acceleration[i]) / time_step
    a = acceleration[i] + slope * s
    v = velocity[i] + s * (acceleration[i] + slope * s / 2.0)
    x = displacement[i] + s * (velocity[i] + s * (acceleration[i] / 2.0 + slope * s / 6.0))
    return np.column_stack((x, v, a))
