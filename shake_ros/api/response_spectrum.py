"""`response_spectrum` over the period and `acceleration_spectra` at several dampings over the frequency."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shake_ros.api.read import Source, naming, one_recording
from shake_ros.control import metrics
from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.accelerograms.accelerogram import Accelerogram
from shake_ros.recordings.bags.bag import SUFFIXES
from shake_ros.report.chart import COLOURS, CURVES, Chart, ChartSeries, Panel, new_figure, static_figure, tidy
from shake_ros.report.result_table import ResultTable
from shake_ros.result_folder import refuse_existing, writing
from shake_ros.signals import response_spectrum as analysis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]
PERIODS = 80
DAMPING, LOW, HIGH, PER_OCTAVE, MOST = (metrics.DAMPING,), 0.1, 100.0, 6, 96
NOTABLE = 0.01  # of the peak, from which a mean that is kept is named


@dataclass(frozen=True, repr=False)
class ResponseSpectrum:
    """A response spectrum, all arrays of shape (m,).

    Attributes
    ----------
    name : of the recording or accelerogram.
    damping : ξ [-].
    periods : natural periods [s].
    displacement : largest relative displacement [m].
    velocity : pseudo-velocity [m/s].
    acceleration : largest absolute acceleration [m/s²].
    """

    name: str
    damping: float
    periods: Array
    displacement: Array
    velocity: Array
    acceleration: Array

    def __repr__(self) -> str:
        peak = int(np.argmax(self.acceleration))
        return (
            f"{self.name}: response spectrum, {100.0 * self.damping:g} % damping, {len(self.periods)} periods from "
            f"{self.periods.min():.3g} to {self.periods.max():.3g} s, "
            f"at most {self.acceleration[peak]:.4g} m/s² at {self.periods[peak]:.3g} s"
        )

    def plot(self) -> Figure:
        """Absolute acceleration and relative displacement over the period."""
        return static_figure(spectrum_chart({self.name: self}))


def spectrum_chart(spectra: Mapping[str, ResponseSpectrum]) -> Chart:
    """Absolute acceleration and relative displacement of spectra over the same periods, by label."""
    first = next(iter(spectra.values()))
    curves = list(zip(spectra.items(), CURVES, strict=False))
    felt = tuple(ChartSeries(label, s.acceleration, colour) for (label, s), colour in curves)
    moved = tuple(ChartSeries(label, 1e3 * s.displacement, colour) for (label, s), colour in curves)
    panels = (
        Panel("acceleration [m/s²]", first.periods, felt, height=220),
        Panel("displacement [mm]", first.periods, moved, height=150),
    )
    caption = (
        f"Response spectrum at {100.0 * first.damping:g} % damping: absolute acceleration and relative displacement"
    )
    return Chart("spectrum", "period [s]", panels, caption, log_x=True)


@dataclass(frozen=True, repr=False)
class AccelerationSpectra:
    """Largest absolute accelerations of oscillators on a table.

    Attributes
    ----------
    name : of what they are of.
    damping : (k,) ξ [-].
    frequencies : (m,) natural frequencies [Hz].
    acceleration : (k, m) [m/s²].
    peak : largest acceleration of the record itself [m/s²].
    mean : of the record as read [m/s²].
    subtracted : whether it was taken off.
    """

    name: str
    damping: tuple[float, ...]
    frequencies: Array
    acceleration: Array
    peak: float
    mean: float = 0.0
    subtracted: bool = False

    @property
    def frame(self) -> ResultTable:
        """A row a frequency, a column a damping."""
        heads = tuple(f"{100.0 * d:g} % [m/s²]" for d in self.damping)
        rows = [(float(f), *map(float, found)) for f, found in zip(self.frequencies, self.acceleration.T, strict=True)]
        return ResultTable(("frequency [Hz]", *heads), rows)

    def __repr__(self) -> str:
        mean = f", its mean of {self.mean:.4g} m/s² subtracted" if self.subtracted else ""
        if not self.subtracted and abs(self.mean) > NOTABLE * self.peak:
            mean = f", its mean of {self.mean:.4g} m/s² kept (--subtract-mean removes it)"
        return f"{self.name}: absolute acceleration, peak of the record {self.peak:.4g} m/s²{mean}\n{self.frame!r}"

    def plot(self) -> Figure:
        """Acceleration over the frequency, a curve a damping."""
        figure = new_figure(8.0, 4.5)
        axes = figure.subplots()
        for found, damping, colour in zip(self.acceleration, self.damping, COLOURS * 4, strict=False):
            axes.loglog(self.frequencies, found, color=colour, label=f"{100.0 * damping:g} %")
        tidy(axes, "frequency [Hz]", "absolute acceleration [m/s²]")
        axes.legend(frameon=False, title="damping")
        return figure

    def write(self, path: str | Path, force: bool = False) -> None:
        """Columns of frequency and acceleration, comma-separated; `force` replaces a file."""
        out = Path(path)
        refuse_existing(out, force=force)
        head = ",".join(["frequency [Hz]", *(f"acceleration at {100.0 * d:g} % [m/s2]" for d in self.damping)])
        rows = np.column_stack([self.frequencies, self.acceleration.T])
        with writing():
            out.parent.mkdir(parents=True, exist_ok=True)
            np.savetxt(out, rows, fmt="%.9g", delimiter=",", header=head, comments="")


def response_spectrum(
    source: Source | Accelerogram | npt.ArrayLike,
    periods: npt.ArrayLike | None = None,
    damping: float = metrics.DAMPING,
    sample_time: float | None = None,
) -> ResponseSpectrum:
    """The elastic response spectrum of an acceleration, with the free vibration behind it (Nigam and Jennings, 1969).

    Parameters
    ----------
    source : a recording with acceleration, an accelerogram, the path of one, a simulation, or an array of shape (n,)
        [m/s²].
    periods : natural periods; 80 from 1/15 to 2 s where not given [s].
    damping : ξ, from 0 to below 1 [-].
    sample_time : of an array [s].

    Raises
    ------
    ShakeError
        No acceleration, an array without sample time, periods or damping out of range.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sine = np.sin(2 * np.pi * 2 * np.arange(20000) / 1000)
    >>> found = sr.response_spectrum(sine, periods=[0.5], damping=0.05, sample_time=0.001)
    >>> round(float(found.acceleration[0]), 2)  # resonance: about 1/(2 ξ)
    10.05
    """
    name, felt, step = _acceleration(source, sample_time)
    whole = np.geomspace(1.0 / metrics.HIGHEST, 1.0 / metrics.LOWEST, PERIODS)
    wanted = whole if periods is None else np.atleast_1d(np.asarray(periods, dtype=float))
    if not np.all(wanted > 0.0):
        raise ShakeError(f"{name}: periods must be above 0 s")
    found = _found(name, felt, step, 1.0 / wanted, damping)
    velocity = 2.0 * np.pi / wanted * found.displacement
    return ResponseSpectrum(name, damping, wanted, found.displacement, velocity, np.abs(found.acceleration))


def acceleration_spectra(
    source: Source | Accelerogram,
    damping: Sequence[float] = DAMPING,
    low: float = LOW,
    high: float | None = None,
    per_octave: int = PER_OCTAVE,
    subtract_mean: bool = False,
    band_limited: bool = False,
) -> AccelerationSpectra:
    """Absolute acceleration spectra, as of `response_spectrum`, at several dampings and over the frequency.

    Parameters
    ----------
    source : a recording with acceleration, an accelerogram, the path of one, or a simulation.
    damping : damping ratios ξ, one or several [-].
    low : lowest frequency [Hz].
    high : highest frequency; 100 Hz, or 0.45 of the sampling rate where that is lower, if not given [Hz].
    per_octave : frequencies in each octave.
    subtract_mean : subtract the mean first, as a sensor's offset.
    band_limited : take the record as a sensor's band-limited samples instead of straight lines between them, which at
        0.1 of the sampling rate are 3 % too low and at 0.4 a third; it begins and ends at rest then.

    Raises
    ------
    ShakeError
        No acceleration, a band or damping out of range.

    Examples
    --------
    >>> import shake_ros as sr
    >>> time = np.arange(20000) / 1000
    >>> run = sr.recording("sine", time, 0 * time, 0 * time, acceleration=np.sin(2 * np.pi * 2 * time))
    >>> found = sr.acceleration_spectra(run, damping=[0.05, 0.1], low=2.0, high=4.0, per_octave=1)
    >>> found.acceleration.round(2).tolist()  # at the resonance √(1 + 4ξ²)/(2ξ); above it the start from rest shows
    [[10.05, 1.62], [5.1, 1.54]]
    """
    name, felt, step = _acceleration(source)
    last = min(HIGH, analysis.HIGHEST / step) if high is None else high
    if not 0.0 < low < last < math.inf:
        raise ShakeError(f"{name}: the band {low:g} … {last:g} Hz does not rise from above 0")
    if not 1 <= per_octave <= MOST:
        raise ShakeError(f"{name}: {per_octave} frequencies of an octave are not within 1 … {MOST}")
    if not damping:
        raise ShakeError(f"{name}: no damping is given")
    f = np.geomspace(low, last, max(2, math.ceil(per_octave * math.log2(last / low) - 1e-9) + 1))
    mean = float(np.mean(felt))
    if subtract_mean:
        felt = felt - mean
    found = np.array([np.abs(_found(name, felt, step, f, d, band_limited).acceleration) for d in damping])
    return AccelerationSpectra(name, tuple(damping), f, found, float(np.max(np.abs(felt))), mean, subtract_mean)


def _found(
    name: str, felt: Array, step: float, frequencies: Array, damping: float, band_limited: bool = False
) -> analysis.Peaks:
    try:
        return analysis.response_spectrum(felt, step, frequencies, damping, band_limited)
    except ShakeError as error:
        raise ShakeError(f"{name}: {error}") from None


def _acceleration(
    source: Source | Accelerogram | npt.ArrayLike, sample_time: float | None = None
) -> tuple[str, Array, float]:
    """Name, acceleration (n,) [m/s²] and sample time [s] of what was given."""
    path = Path(source) if isinstance(source, str | Path) else None
    if path is not None and path.is_file() and not path.name.endswith(SUFFIXES):
        source = read_accelerogram(path)
    if isinstance(source, Accelerogram):
        return source.name, source.acceleration, source.time_step
    if isinstance(source, list | tuple | np.ndarray):
        if sample_time is None:
            raise ShakeError("response_spectrum: an array needs its sample_time")
        return "acceleration", np.asarray(source, dtype=np.float64), sample_time
    with naming(source):  # type: ignore[arg-type]
        part = one_recording(source).longest  # type: ignore[arg-type]
        if part.acceleration is None:
            raise ShakeError("no topic imu: there is no acceleration")
        return part.name, part.acceleration, part.sample_time
