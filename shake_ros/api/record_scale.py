"""`accelerogram`, `record_scale`: a record as it is distributed, and the motion that a table can play of it."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from numpy.typing import NDArray

from shake_ros.api.response_spectrum import ResponseSpectrum, response_spectrum, spectrum_chart
from shake_ros.control.reference.baseline import integrate
from shake_ros.control.reference.motion import EarthquakeRecord, envelope
from shake_ros.control.reference.program import Shaping
from shake_ros.control.reference.recorded import EarthquakeParameters, Fitted
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import Parameters, ShakeError, quantity
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.accelerograms.accelerogram import Accelerogram
from shake_ros.recordings.reference_file import load_reference
from shake_ros.report.chart import CURVES, Chart, ChartSeries, Panel, static_figure
from shake_ros.report.page import Page
from shake_ros.report.result_table import ResultTable
from shake_ros.result_folder import writing
from shake_ros.settings import load_parameters, load_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILL = "fill"
LARGEST_FACTOR = 1e4
PERIODS = 80
YAML = (".yaml", ".yml")
READ = (("acceleration", "m/s²", 1.0), ("velocity", "mm/s", 1e3), ("displacement", "mm", 1e3))
"""Quantities of a motion with the unit that a page gives them in, and its factor."""


@dataclass(frozen=True)
class ScaleParameters(Parameters):
    """Content of config/record_scale.yaml."""

    position_share: float = quantity("-", "usable share of half the stroke", low=0.01, high=1.0)
    velocity_share: float = quantity("-", "usable share of the largest velocity", low=0.01, high=1.0)
    acceleration_share: float = quantity("-", "usable share of the largest acceleration", low=0.01, high=1.0)
    spectrum_damping: float = quantity("-", "damping of the response spectrum", low=0.0, high=0.99)
    shortest_period: float = quantity("s", "shortest period of the spectrum", low=0.001, high=100.0)
    longest_period: float = quantity("s", "longest period of the spectrum", low=0.001, high=100.0)

    @property
    def periods(self) -> NDArray[np.float64]:
        """Of the response spectrum [s]."""
        return np.geomspace(self.shortest_period, self.longest_period, PERIODS)


@dataclass(frozen=True, repr=False)
class ScaledRecord:
    """A record made fit for a table.

    Attributes
    ----------
    path : the file.
    read : what it holds.
    parameters : its treatment and the limits.
    shaping : of the reference.
    fitted : acceleration for the table [m/s²], its time step [s], the factor on the record.
    """

    path: Path
    read: Accelerogram
    parameters: EarthquakeParameters
    shaping: Shaping
    fitted: Fitted
    scale: ScaleParameters

    @property
    def band(self) -> str:
        """Frequencies that are left in the motion, in words."""
        return band_of(self.parameters)

    def spectrum(self) -> ResponseSpectrum:
        """Response spectrum of the motion for the table."""
        return self._spectrum(self.fitted.acceleration, self.fitted.time_step)

    def _spectrum(self, acceleration: NDArray[np.float64], step: float) -> ResponseSpectrum:
        return response_spectrum(acceleration, self.scale.periods, self.scale.spectrum_damping, step)

    def plot(self) -> Figure:
        """Histories of the record and of the motion for the table."""
        return static_figure(self._history())

    def _history(self) -> Chart:
        """Acceleration, velocity and displacement, as recorded and for the table, on one time axis."""
        read, fitted = self.read, self.fitted
        pad = (fitted.acceleration.size - read.acceleration.size) / 2 * fitted.time_step
        step = min(read.time_step, fitted.time_step)
        begin = min(pad, 0.0)
        end = max(
            pad + read.time_step * (read.acceleration.size - 1), fitted.time_step * (fitted.acceleration.size - 1)
        )
        time = begin + np.arange(round((end - begin) / step) + 1) * step

        def motion(acceleration: NDArray[np.float64], step: float, start: float) -> list[NDArray[np.float64]]:
            own = start + np.arange(acceleration.size) * step
            signals = (acceleration, *integrate(acceleration, step))
            return [np.interp(time, own, s, left=np.nan, right=np.nan) for s in signals]

        before, after = (
            motion(read.acceleration, read.time_step, pad),
            motion(fitted.acceleration, fitted.time_step, 0.0),
        )
        panels = tuple(
            Panel(
                f"{name} [{unit}]",
                time,
                (ChartSeries("as recorded", scale * was, CURVES[0]), ChartSeries(self._label, scale * now, CURVES[1])),
            )
            for (name, unit, scale), was, now in zip(READ, before, after, strict=True)
        )
        return Chart("motion", "time [s]", panels, "The motion as recorded and as played")

    @property
    def _label(self) -> str:
        return f"for the table, factor {self.fitted.factor:.3g}"

    def page(self) -> Page:
        """What was changed, histories and response spectra."""
        read = self.read
        page = Page("An accelerogram for the table", f"{self.path.name}: {read.name}")
        channel = f", channel {self.parameters.channel}" if self.parameters.channel > 1 else ""
        page.paragraph(
            f"{read.format}, {read.acceleration.size} samples of {read.time_step:g} s in {read.unit}{channel}."
        )
        for warning in read.warnings:
            page.paragraph(f"Warning: {warning}.")
        page.heading("What was changed")
        for change in self.changes:
            page.paragraph(change)
        page.result(self.table)
        page.heading("The motion")
        page.chart(self._history())
        page.heading("Response spectrum")
        recorded = self._spectrum(read.acceleration, read.time_step)
        page.chart(spectrum_chart({"as recorded": recorded, self._label: self.spectrum()}))
        return page

    @property
    def table(self) -> ResultTable:
        """Peaks of the motion beside the table's limits, and what is left at its end."""
        p = self.parameters
        limits = (p.acceleration_limit, p.velocity_limit, p.position_limit)
        motions = list(zip(*self._motions(), strict=True))
        rows: list[tuple[str | float | None, ...]] = [
            (f"{name} [{unit}]", *(scale * peak for peak, _ in motion), scale * limit)
            for (name, unit, scale), motion, limit in zip(READ, motions, limits, strict=True)
        ]
        for (name, unit, scale), motion in zip(READ[1:], motions[1:], strict=True):
            rows.append((f"{name} at the end [{unit}]", *(scale * end for _, end in motion), None))
        return ResultTable(("peak", "as recorded", "corrected", "for the table", "limit"), rows)

    def _motions(self) -> tuple[list[tuple[float, float]], ...]:
        """Peaks and ends as recorded, corrected and for the table, as of `_three`."""
        read, fitted = self.read, self.fitted
        unscaled = fitted.acceleration / fitted.factor if fitted.factor else fitted.acceleration
        return (
            _three(read.acceleration, read.time_step),
            *(_three(a, fitted.time_step) for a in (unscaled, fitted.acceleration)),
        )

    @property
    def changes(self) -> list[str]:
        """What was done to the motion, a sentence each."""
        (recorded, *_), (corrected, *_), (played, *_) = self._motions()
        p, fitted = self.parameters, self.fitted
        sentences = [
            f"Filtered to {self.band} and baseline-corrected: the peak acceleration goes from {recorded[0]:.4g} to "
            f"{corrected[0]:.4g} m/s².",
            f"Scaled by {fitted.factor:.5g}: the peak acceleration is {played[0]:.4g} m/s²."
            if fitted.factor != 1.0
            else "Not scaled.",
        ]
        if fitted.limited_by:
            asked = "as large as it fits" if p.scale == LARGEST_FACTOR else f"{p.scale:g}"
            sentences.append(
                f"The requested factor was {asked}; the factor is what the table's {fitted.limited_by.split('_')[0]} "
                "allows."
            )
        if p.time_scale != 1.0:
            sentences.append(f"Time is stretched by {p.time_scale:g}.")
        return sentences

    def write(self, out: str | Path) -> None:
        """Write columns (.csv) or a configuration of reference_generator (.yaml)."""
        path = Path(out)
        if path.suffix not in (".csv", *YAML):
            raise ShakeError(f"{path}: give a name that ends in .csv or .yaml")
        with writing():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(self._yaml() if path.suffix in YAML else self._csv(), encoding="utf-8")

    def _csv(self) -> str:
        """Columns time, acceleration, velocity, position, with the treatment in comments."""
        fitted = self.fitted
        velocity, position = integrate(fitted.acceleration, fitted.time_step)
        time = np.arange(fitted.acceleration.size) * fitted.time_step
        head = [
            f"# {self.path.name}: {self.read.name}",
            f"# factor {fitted.factor:.9g}, time scale {self.parameters.time_scale:g}",
            "time [s],acceleration [m/s2],velocity [m/s],position [m]",
        ]
        rows = zip(time, fitted.acceleration, velocity, position, strict=True)
        return "\n".join([*head, *(f"{t:.9g},{a:.9e},{v:.9e},{x:.9e}" for t, a, v, x in rows)]) + "\n"

    def _yaml(self) -> str:
        """A configuration of reference_generator that plays the record in the same way."""
        final = self.parameters.replace(scale=self.fitted.factor)
        content = {"kind": "earthquake", **dataclasses.asdict(final), "shaping": dataclasses.asdict(self.shaping)}
        body: str = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
        return f"# {self.read.name}, fitted by record_scale. SI units.\n{body}"

    def __repr__(self) -> str:
        return self.page().text()


def band_of(parameters: EarthquakeParameters) -> str:
    """Frequencies that a treatment leaves, in words."""
    low, high = parameters.high_pass, parameters.low_pass
    return f"{low:g} … {high:g} Hz" if high else f"from {low:g} Hz"


def treatment() -> tuple[EarthquakeParameters, Shaping]:
    """The treatment of records in config/reference/earthquake.yaml."""
    reference = load_reference("earthquake")
    assert isinstance(reference.parameters, EarthquakeParameters)
    return reference.parameters, reference.shaping


def accelerogram(path: str | Path, channel: int = 0, unit: str = "") -> Accelerogram:
    """An accelerogram as it is distributed.

    Formats: PEER .AT2 and other text of `NPTS DT`, CSMIP and CDMG .V1, .V2, COSMOS .V1c, .V2c, USGS .smc, K-NET,
    KiK-net, ESM, AFAD, GeoNet .V1A, .V2A, and tables of columns (text, .xlsx, .tdms, .mat).

    Parameters
    ----------
    path : the file.
    channel : of a file that has several, from 1; 0: it holds one.
    unit : of a file that does not name its own.

    Raises
    ------
    ShakeError
        One line with file, line and reason.

    Examples
    --------
    >>> import shake_ros as sr
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "record.csv"
    >>> rows = "".join(f"{k / 100:.2f},{(k % 5) / 10}\\n" for k in range(200))
    >>> _ = file.write_text("time [s],acceleration [m/s2]\\n" + rows)
    >>> record = sr.accelerogram(file)
    >>> record.peak, record.unit
    (0.4, 'm/s2')
    """
    return read_accelerogram(path, channel=channel, unit=unit)


def record_scale(
    path: str | Path,
    table: str | TableParameters = "bergamo",
    *,
    scale: str | float = 1.0,
    fit: bool = False,
    channel: int = 0,
    unit: str = "",
    stroke: float | None = None,
    velocity: float | None = None,
    acceleration: float | None = None,
    time_scale: float | None = None,
    high_pass: float | None = None,
    low_pass: float | None = None,
) -> ScaledRecord:
    """A record, baseline-corrected, filtered to a band and scaled into the table's envelope.

    Parameters
    ----------
    path : an accelerogram.
    table : whose envelope is used: a name of config/table, a YAML file, or a table.
    scale : factor on the acceleration, or "fill": as large as the table allows [-].
    fit : reduce a factor that does not fit to the largest that does, instead of refusing it.
    channel : of a file that has several, from 1; 0: it holds one.
    unit : m/s2, cm/s2 or g, of a file that does not name its own.
    stroke : largest displacement from the middle; that of the table where not given [m].
    velocity : largest velocity; that of the table where not given [m/s].
    acceleration : largest acceleration; that of the table where not given [m/s²].
    time_scale : factor on the time, below 1 is faster; that of config/reference/earthquake.yaml where not given [-].
    high_pass : lower end of the band, 0 for none; that of the same file where not given [Hz].
    low_pass : upper end of the band, 0 for none; that of the same file where not given [Hz].

    Raises
    ------
    ShakeError
        A file that is no record, nothing left within the band, a limit out of bounds; a factor that does not fit.

    Examples
    --------
    >>> import shake_ros as sr
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "record.csv"
    >>> t = np.arange(2000) / 100
    >>> felt = 3 * np.sin(2 * np.pi * 2 * t) * np.hanning(2000)
    >>> rows = "".join(f"{time:.2f},{a:.6f}\\n" for time, a in zip(t, felt))
    >>> _ = file.write_text("time [s],acceleration [m/s2]\\n" + rows)
    >>> found = sr.record_scale(file, scale="fill", stroke=0.02)
    >>> found.band, found.fitted.limited_by
    ('0.25 … 12 Hz', 'position_limit')
    """
    settings = load_parameters("record_scale", "default", ScaleParameters)
    base, shaping = treatment()
    bounds = envelope(load_table(table))
    changes: dict[str, float | int | str] = {
        "position_limit": settings.position_share * bounds.position,
        "velocity_limit": settings.velocity_share * bounds.velocity,
        "acceleration_limit": settings.acceleration_share * bounds.acceleration,
        "scale": LARGEST_FACTOR if scale == FILL else _number(scale),
        "channel": channel,
        "unit": unit,
    }
    given = {
        "position_limit": stroke,
        "velocity_limit": velocity,
        "acceleration_limit": acceleration,
        "time_scale": time_scale,
        "high_pass": high_pass,
        "low_pass": low_pass,
    }
    base = base.replace(**changes | {name: value for name, value in given.items() if value is not None})
    read = read_accelerogram(path, channel=channel, unit=unit)
    parameters = base.replace(record=str(path))
    try:
        fitted = parameters.fit(EarthquakeRecord(read.time, read.acceleration))
    except ShakeError as error:
        raise ShakeError(f"{path}: {error}") from None
    if scale != FILL and fitted.limited_by and not fit:
        raise ShakeError(f"{path}: {_does_not_fit(parameters, fitted)}")
    if scale == FILL and not fitted.limited_by:
        raise ShakeError(f"{path}: no limit reached at a factor of {LARGEST_FACTOR:g}; is this an accelerogram?")
    return ScaledRecord(Path(path), read, parameters, shaping, fitted, settings)


def _does_not_fit(asked: EarthquakeParameters, fitted: Fitted) -> str:
    """Which limit a factor exceeds, by how much, and which one fits."""
    name, over = fitted.limited_by, asked.scale / fitted.factor
    units = {"position_limit": "m", "velocity_limit": "m/s", "acceleration_limit": "m/s²"}
    limit, kept = getattr(asked, name), math.floor(1e4 * fitted.factor) / 1e4
    text = f"at the scale {asked.scale:g} it needs {over:.2f} times the {name.partition('_')[0]} that the table may use"
    return f"{text} ({limit:.4g} {units[name]}); --scale {kept:g} fits, --fit scales it to the largest that fits"


def _number(text: float | str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ShakeError(f"--scale '{text}' is neither a number nor 'fill'") from None


def _three(acceleration: NDArray[np.float64], step: float) -> list[tuple[float, float]]:
    """Peak and end value of acceleration, velocity and displacement."""
    signals = (acceleration, *integrate(acceleration, step))
    return [(float(np.max(np.abs(signal))), float(signal[-1])) for signal in signals]
