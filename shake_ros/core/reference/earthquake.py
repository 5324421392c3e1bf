"""Earthquake: a recorded or synthetic acceleration, baseline-corrected and fitted into the table's envelope.

The record's acceleration is multiplied by `scale`, its time by `time_scale` (below 1 plays faster, as for a
model at reduced length), and then by the one factor that keeps displacement, velocity and acceleration within
their limits. A factor below `scale` is reported, never hidden.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.core.reference.baseline import correct_baseline, integrate, resample
from shake_ros.core.reference.motion import LONGEST, Array, EarthquakeRecord, Motion
from shake_ros.core.reference.synthetic import accelerogram

UNITS = ("", "m/s2", "cm/s2", "g")


@dataclass(frozen=True)
class EarthquakeParameters(Parameters):
    record: str = choice("path of an accelerogram; empty = synthetic")
    channel: int = quantity("-", "channel of a record that has several, from 1; 0 = it has one", low=0, high=1000)
    unit: str = choice("unit of a record that does not name its own; empty = as the record says", UNITS)
    scale: float = quantity("-", "factor on the acceleration, reduced to meet the limits", low=0.0, high=1e4, live=True)
    time_scale: float = quantity("-", "factor on the time, below 1 = faster", low=0.01, high=100.0)
    high_pass: float = quantity("Hz", "lower end of the band; 0 = none", low=0.0, high=50.0)
    low_pass: float = quantity("Hz", "upper end of the band; 0 = none", low=0.0, high=1000.0)
    pad_time: float = quantity("s", "rest before and after, for the filter", low=0.0, high=120.0)
    position_limit: float = quantity("m", "largest displacement asked for", low=1e-6, high=10.0)
    velocity_limit: float = quantity("m/s", "largest velocity asked for", low=1e-6, high=100.0)
    acceleration_limit: float = quantity("m/s²", "largest acceleration asked for", low=1e-6, high=1000.0)
    synthetic_seed: int = quantity("-", "seed of the synthetic record", low=0, high=2**31 - 1)
    synthetic_duration: float = quantity("s", "length of the synthetic record", low=1.0, high=600.0)
    synthetic_time_step: float = quantity("s", "time step of the synthetic record", low=1e-4, high=0.1)
    synthetic_peak: float = quantity("m/s²", "largest acceleration of the synthetic record", low=1e-6, high=100.0)
    ground_frequency: float = quantity("Hz", "f_g of the Kanai–Tajimi filter", low=0.01, high=100.0)
    ground_damping: float = quantity("-", "ξ_g of the Kanai–Tajimi filter", low=0.01, high=10.0)
    rock_frequency: float = quantity("Hz", "f_f of the Clough–Penzien filter", low=0.001, high=100.0)
    rock_damping: float = quantity("-", "ξ_f of the Clough–Penzien filter", low=0.01, high=10.0)
    envelope_peak: float = quantity("-", "place of the envelope's peak in the record", low=0.01, high=0.9)
    envelope_end: float = quantity("-", "level of the envelope at the record's end", low=1e-6, high=0.9)


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
        raise ShakeError(f"earthquake: record of shapes {time.shape} and {raw.shape} needs at least 8 samples each")
    if not (np.all(np.isfinite(time)) and np.all(np.isfinite(raw))):
        raise ShakeError("earthquake: record holds values that are not finite numbers")
    recorded_step = float(time[-1] - time[0]) / (time.size - 1)
    if recorded_step <= 0.0 or np.max(np.abs(np.diff(time) - recorded_step)) > 0.01 * recorded_step:
        raise ShakeError("earthquake: record is not uniform in time")
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
        raise ShakeError(f"earthquake: record '{parameters.record}' was named but not handed over")
    fitted = fit(parameters, synthetic_record(parameters) if record is None else record)
    if fitted.acceleration.size * fitted.time_step / sample_time > LONGEST:
        raise ShakeError(f"earthquake: record gives more than {LONGEST} samples at {sample_time:g} s")
    notes: dict[str, Any] = {
        "factor": fitted.factor,
        "limited_by": fitted.limited_by,
        "time_scale": parameters.time_scale,
        "source": parameters.record or f"synthetic, seed {parameters.synthetic_seed}",
    }
    states = resample(fitted.acceleration, fitted.time_step, sample_time)
    states[-1, 1:] = 0.0
    return Motion(states, notes)
