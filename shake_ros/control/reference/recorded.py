"""Accelerations from a file: an earthquake's record, fitted into the table's envelope, and a drive, played as it is.

Both need uniform samples, all finite, at least eight of them.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.reference.baseline import correct_baseline, integrate, resample
from shake_ros.control.reference.motion import (
    LONGEST,
    Array,
    EarthquakeRecord,
    Motion,
    ReferenceParameters,
    sample_times,
)
from shake_ros.quantities import ShakeError, choice, quantity

UNITS = ("", "m/s2", "cm/s2", "g")
REST = 1.0  # length of a drive without a record [s]
AT_REST = 1e-4  # of a drive's largest velocity, and of its largest displacement, that may be left at its end


@dataclass(frozen=True)
class RecordedParameters(ReferenceParameters):
    """Where the accelerations are."""

    record: str = choice("path of the accelerations; empty = none")
    channel: int = quantity(
        "-", "channel of an accelerogram that has several, from 1; 0 = it has one", low=0, high=1000
    )
    unit: str = choice("unit of an accelerogram that names none; empty = as the file says", UNITS)

    @abstractmethod
    def motion(self, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
        """Its samples every `sample_time` [s]; `record` is what the file holds."""


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


class Fitted(NamedTuple):
    """A record made fit for the table."""

    acceleration: Array  # (m,) [m/s²]
    time_step: float  # [s], after time scaling
    factor: float  # applied to the record's acceleration [-]
    limited_by: str  # name of the limit that reduced `scale` to `factor`, empty if none did


@dataclass(frozen=True)
class EarthquakeParameters(RecordedParameters):
    """A recorded or synthetic acceleration, baseline-corrected and fitted into the table's envelope.

    The record's acceleration is multiplied by `scale`, its time by `time_scale` (below 1 plays faster, as for a
    model at reduced length), and then by the one factor that keeps displacement, velocity and acceleration within
    their limits. A factor below `scale` is reported, never hidden.

    The synthetic accelerogram is seeded noise through the Clough–Penzien filter, under the Saragoni–Hart envelope.

    Sources: K. Kanai (1957) and H. Tajimi (1960) for the ground filter; R. W. Clough and J. Penzien, Dynamics of
    Structures (1975), for the high-pass filter in series; G. R. Saragoni and G. C. Hart (1974) for the envelope,
    with the constants of D. M. Boore, Pure and Applied Geophysics 160 (2003), 635–676, eq. (20)–(23).
    The noise is numpy's `RandomState`, whose stream is frozen, so a seed means the same record with every version.
    """

    record: str = choice("path of an accelerogram; empty = synthetic")
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

    def synthetic_record(self) -> EarthquakeRecord:
        """The synthetic accelerogram that the parameters describe."""
        count = round(self.synthetic_duration / self.synthetic_time_step) + 1
        time: Array = np.arange(count, dtype=np.float64) * self.synthetic_time_step
        noise = np.random.RandomState(self.synthetic_seed).standard_normal(count)
        padded = 2 * count  # room for the filter's ringing, so that the end does not wrap to the start
        frequency = np.asarray(np.fft.rfftfreq(padded, self.synthetic_time_step), dtype=np.float64)
        ground, rock = (self.ground_frequency, self.ground_damping), (self.rock_frequency, self.rock_damping)
        spectrum = np.fft.rfft(noise, padded) * ground_filter(frequency, ground, rock)
        level = envelope(time, self.synthetic_duration, self.envelope_peak, self.envelope_end)
        shaped = np.fft.irfft(spectrum, padded)[:count] * level
        return EarthquakeRecord(time, shaped * (self.synthetic_peak / np.max(np.abs(shaped))))

    def fit(self, record: EarthquakeRecord) -> Fitted:
        """Baseline-corrected, scaled and limited acceleration of a record.

        Raises ShakeError for a record that is too short, not finite, not uniform, or nothing within the band.
        """
        step = _uniform_step("earthquake", record) * self.time_scale
        wished = self.scale * correct_baseline(record.acceleration, step, self.high_pass, self.low_pass, self.pad_time)
        velocity, displacement = integrate(wished, step)
        factor, limited_by = 1.0, ""
        for name, signal, limit in (
            ("position_limit", displacement, self.position_limit),
            ("velocity_limit", velocity, self.velocity_limit),
            ("acceleration_limit", wished, self.acceleration_limit),
        ):
            largest = float(np.max(np.abs(signal)))
            if largest * factor > limit:
                factor, limited_by = limit / largest, name
        return Fitted(factor * wished, step, factor * self.scale, limited_by)

    def motion(self, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
        """The fitted record as displacement, velocity and acceleration; None = the synthetic one."""
        if record is None and self.record:
            raise ShakeError(f"earthquake: record '{self.record}' was named but not given")
        fitted = self.fit(self.synthetic_record() if record is None else record)
        if fitted.acceleration.size * fitted.time_step / sample_time > LONGEST:
            raise ShakeError(f"earthquake: the accelerogram gives more than {LONGEST} samples at {sample_time:g} s")
        notes: dict[str, Any] = {
            "factor": fitted.factor,
            "limited_by": fitted.limited_by,
            "time_scale": self.time_scale,
            "source": self.record or f"synthetic, seed {self.synthetic_seed}",
        }
        states = resample(fitted.acceleration, fitted.time_step, sample_time)
        states[-1, 1:] = 0.0
        return Motion(states, notes)


@dataclass(frozen=True)
class DriveParameters(RecordedParameters):
    """An acceleration that begins and ends at rest, played as it is; nothing is corrected, filtered or limited.

    What `iterate` and `qualify` make is such a drive: its velocity and displacement follow by integrals that are exact
    for an acceleration linear between samples.
    """

    record: str = choice("path of the drive's accelerations; empty = the table rests")
    scale: float = quantity("-", "factor on the acceleration", low=0.0, high=1e4, live=True)

    def motion(self, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
        """The drive as displacement, velocity and acceleration.

        Raises ShakeError for one that is too short, not finite, not uniform, or does not end at rest where it began.
        """
        if record is None:
            if self.record:
                raise ShakeError(f"drive: record '{self.record}' was named but not given")
            return Motion(np.zeros((sample_times(REST, sample_time).size, 3)), {})
        states = resample(self.scale * record.acceleration, _uniform_step("drive", record), sample_time)
        largest = np.max(np.abs(states), axis=0)
        for name, column in (("displacement", 0), ("velocity", 1)):
            if abs(states[-1, column]) > AT_REST * largest[column]:
                share = 100.0 * abs(states[-1, column]) / largest[column]
                raise ShakeError(
                    f"drive: {share:.2g} % of its {name} is left at its end; an accelerogram is played as `earthquake`"
                )
        states[-1, 1:] = 0.0
        return Motion(states, {"source": self.record})


def _uniform_step(kind: str, record: EarthquakeRecord) -> float:
    """Time between the samples of a record [s]; ShakeError where it cannot be played."""
    time, acceleration = record
    if time.shape != acceleration.shape or time.ndim != 1 or time.size < 8:
        raise ShakeError(
            f"{kind}: accelerogram of shapes {time.shape} and {acceleration.shape} needs at least 8 samples each"
        )
    if not np.isfinite(time + acceleration).all():
        raise ShakeError(f"{kind}: the accelerogram has values that are not finite numbers")
    step = float(time[-1] - time[0]) / (time.size - 1)
    if step <= 0.0 or np.max(np.abs(np.diff(time) - step)) > 0.01 * step:
        raise ShakeError(f"{kind}: the accelerogram is not uniform in time")
    return step
