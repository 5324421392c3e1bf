"""Earthquake: a recorded or synthetic acceleration, baseline-corrected and fitted into the table's envelope.

The record's acceleration is multiplied by `scale`, its time by `time_scale` (below 1 plays faster, as for a
model at reduced length), and then by the one factor that keeps displacement, velocity and acceleration within
their limits. A factor below `scale` is reported, never hidden.

The synthetic accelerogram is seeded noise through the Clough–Penzien filter, under the Saragoni–Hart envelope.

Sources: K. Kanai (1957) and H. Tajimi (1960) for the ground filter; R. W. Clough and J. Penzien, Dynamics of
Structures (1975), for the high-pass filter in series; G. R. Saragoni and G. C. Hart (1974) for the envelope,
with the constants of D. M. Boore, Pure and Applied Geophysics 160 (2003), 635–676, eq. (20)–(23).
The noise is numpy's `RandomState`, whose stream is frozen, so a seed means the same record with every version.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.core.reference.baseline import correct_baseline, integrate, resample
from shake_ros.core.reference.motion import LONGEST, Array, EarthquakeRecord, Motion


def ground_filter(
    frequency: Array, ground: tuple[float, float], high_pass: tuple[float, float]
) -> NDArray[np.complex128]:
    """Complex transfer function from rock to ground acceleration at `frequency` [Hz], shape of `frequency`.

    Parameters
    ----------
    ground : frequency f_g [Hz] and damping ξ_g [-] of Kanai and Tajimi.
    high_pass : frequency f_f [Hz] and damping ξ_f [-] of Clough and Penzien.
    """
    f = np.asarray(frequency, dtype=np.float64)
    (f_g, xi_g), (f_f, xi_f) = ground, high_pass
    kanai_tajimi = (f_g**2 + 2j * xi_g * f_g * f) / (f_g**2 - f**2 + 2j * xi_g * f_g * f)
    clough_penzien = -(f**2) / (f_f**2 - f**2 + 2j * xi_f * f_f * f)
    return np.asarray(kanai_tajimi * clough_penzien, dtype=np.complex128)


def envelope(time: Array, duration: float, peak_place: float, end_level: float) -> Array:
    """Saragoni–Hart envelope a (t/T)^b exp(−c t/T): 1 at t = peak_place·T, `end_level` at t = T = `duration`."""
    b = -peak_place * np.log(end_level) / (1.0 + peak_place * (np.log(peak_place) - 1.0))
    c = b / peak_place
    tau = np.asarray(time, dtype=np.float64) / duration
    return np.asarray((tau / peak_place) ** b * np.exp(b - c * tau))


def accelerogram(
    seed: int,
    duration: float,
    time_step: float,
    ground: tuple[float, float],
    high_pass: tuple[float, float],
    peak_place: float,
    end_level: float,
    peak: float,
) -> EarthquakeRecord:
    """A record of `duration` [s] at `time_step` [s] whose largest magnitude is `peak` [m/s²].

    `ground` and `high_pass` as in `ground_filter`, `peak_place` and `end_level` as in `envelope`.
    """
    count = round(duration / time_step) + 1
    time: Array = np.arange(count, dtype=np.float64) * time_step
    noise = np.random.RandomState(seed).standard_normal(count)
    padded = 2 * count  # room for the filter's ringing, so that the end does not wrap to the start
    frequency = np.asarray(np.fft.rfftfreq(padded, time_step), dtype=np.float64)
    spectrum = np.fft.rfft(noise, padded) * ground_filter(frequency, ground, high_pass)
    shaped = np.fft.irfft(spectrum, padded)[:count] * envelope(time, duration, peak_place, end_level)
    return EarthquakeRecord(time, shaped * (peak / np.max(np.abs(shaped))))


UNITS = ("", "m/s2", "cm/s2", "g")


@dataclass(frozen=True)
class EarthquakeParameters(Parameters):
    record: str = choice("path of an accelerogram; empty = synthetic")
    channel: int = quantity(
        "-", "channel of an accelerogram that has several, from 1; 0 = it has one", low=0, high=1000
    )
    unit: str = choice("unit of an accelerogram that names none; empty = as the file says", UNITS)
    scale: float = quantity("-", "factor on the acceleration, reduced to meet the limits", low=0.0, high=1e4, live=True)
    time_scale: float = quantity("-", "factor on the time, below 1 = faster", low=0.01, high=100.0)
    high_pass: float = quantity("Hz", "lower end of the band; 0 = none", low=0.0, high=50.0)
    low_pass: float = quantity("Hz", "upper end of the band; 0 = none", low=0.0, high=1000.0)
    pad_time: float = quantity("s", "rest before and after, for the filter", low=0.0, high=120.0)
    position_limit: float = quantity("m", "largest displacement asked for", low=1e-6, high=10.0)
    velocity_limit: float = quantity("m/s", "largest velocity asked for", low=1e-6, high=100.0)
    acceleration_limit: float = quantity("m/s²", "largest acceleration asked for", low=1e-6, high=1000.0)
    synthetic_seed: int = quantity("-", "seed of the synthetic accelerogram", low=0, high=2**31 - 1)
    synthetic_duration: float = quantity("s", "length of the synthetic accelerogram", low=1.0, high=600.0)
    synthetic_time_step: float = quantity("s", "time step of the synthetic accelerogram", low=1e-4, high=0.1)
    synthetic_peak: float = quantity("m/s²", "largest acceleration of the synthetic accelerogram", low=1e-6, high=100.0)
    ground_frequency: float = quantity("Hz", "f_g of the Kanai–Tajimi filter", low=0.01, high=100.0)
    ground_damping: float = quantity("-", "ξ_g of the Kanai–Tajimi filter", low=0.01, high=10.0)
    rock_frequency: float = quantity("Hz", "f_f of the Clough–Penzien filter", low=0.001, high=100.0)
    rock_damping: float = quantity("-", "ξ_f of the Clough–Penzien filter", low=0.01, high=10.0)
    envelope_peak: float = quantity("-", "position of the envelope's peak in the accelerogram", low=0.01, high=0.9)
    envelope_end: float = quantity("-", "level of the envelope at the end of the accelerogram", low=1e-6, high=0.9)


class Fitted(NamedTuple):
    """A record made fit for the table.

    acceleration : (m,) [m/s²].
    time_step : [s], after time scaling.
    factor : applied to the record's acceleration [-].
    limited_by : name of the limit that reduced `scale` to `factor`, empty if none did.
    """

    acceleration: Array
    time_step: float
    factor: float
    limited_by: str


def synthetic_record(parameters: EarthquakeParameters) -> EarthquakeRecord:
    """The synthetic accelerogram that the parameters describe."""
    p = parameters
    return accelerogram(
        p.synthetic_seed,
        p.synthetic_duration,
        p.synthetic_time_step,
        (p.ground_frequency, p.ground_damping),
        (p.rock_frequency, p.rock_damping),
        p.envelope_peak,
        p.envelope_end,
        p.synthetic_peak,
    )


def fit(parameters: EarthquakeParameters, record: EarthquakeRecord) -> Fitted:
    """Baseline-corrected, scaled and limited acceleration of a record.

    Raises ShakeError for a record that is too short, not finite, not uniform, or nothing within the band.
    """
    p = parameters
    time, raw = record
    if time.shape != raw.shape or raw.ndim != 1 or raw.size < 8:
        raise ShakeError(
            f"earthquake: accelerogram of shapes {time.shape} and {raw.shape} needs at least 8 samples each"
        )
    if not (np.all(np.isfinite(time)) and np.all(np.isfinite(raw))):
        raise ShakeError("earthquake: the accelerogram has values that are not finite numbers")
    recorded_step = float(time[-1] - time[0]) / (time.size - 1)
    if recorded_step <= 0.0 or np.max(np.abs(np.diff(time) - recorded_step)) > 0.01 * recorded_step:
        raise ShakeError("earthquake: the accelerogram is not uniform in time")
    step = recorded_step * p.time_scale
    wished = p.scale * correct_baseline(raw, step, p.high_pass, p.low_pass, p.pad_time)
    velocity, displacement = integrate(wished, step)
    factor, limited_by = 1.0, ""
    for name, signal, limit in (
        ("position_limit", displacement, p.position_limit),
        ("velocity_limit", velocity, p.velocity_limit),
        ("acceleration_limit", wished, p.acceleration_limit),
    ):
        largest = float(np.max(np.abs(signal)))
        if largest * factor > limit:
            factor, limited_by = limit / largest, name
    return Fitted(factor * wished, step, factor * p.scale, limited_by)


def motion(parameters: EarthquakeParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """The fitted record as displacement, velocity and acceleration; `record` None = the synthetic one."""
    if record is None and parameters.record:
        raise ShakeError(f"earthquake: record '{parameters.record}' was named but not given")
    fitted = fit(parameters, synthetic_record(parameters) if record is None else record)
    if fitted.acceleration.size * fitted.time_step / sample_time > LONGEST:
        raise ShakeError(f"earthquake: the accelerogram gives more than {LONGEST} samples at {sample_time:g} s")
    notes: dict[str, Any] = {
        "factor": fitted.factor,
        "limited_by": fitted.limited_by,
        "time_scale": parameters.time_scale,
        "source": parameters.record or f"synthetic, seed {parameters.synthetic_seed}",
    }
    states = resample(fitted.acceleration, fitted.time_step, sample_time)
    states[-1, 1:] = 0.0
    return Motion(states, notes)
