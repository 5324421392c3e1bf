"""Pages and figures of signals: a record made fit for a table, response spectra, a frequency response, a multisine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shake_ros.core.analysis.frequency_response import COHERENT, FrequencyResponse
from shake_ros.core.analysis.multisine_split import MultisineSplit
from shake_ros.core.analysis.response_spectrum import response_spectrum
from shake_ros.core.reference.baseline import integrate
from shake_ros.report.chart import COLOURS, GREY, Chart, ChartSeries, Panel, new_figure, tidy
from shake_ros.report.page import Made, Page
from shake_ros.report.result_table import ResultTable

Array = NDArray[np.float64]
QUANTITIES = (("acceleration [m/s²]", 1.0), ("velocity [mm/s]", 1e3), ("displacement [mm]", 1e3))
CURVES = ("c5", "c0", "c1", "c2", "c3", "c4")


class Curve(NamedTuple):
    """An acceleration to draw: its label, first instant [s], step [s] and values (n,) [m/s²]."""

    label: str
    start: float
    time_step: float
    acceleration: Array


def record_chart(name: str, curves: Sequence[Curve]) -> Chart:
    """Acceleration, velocity and displacement of all curves on one time axis."""
    step = min(c.time_step for c in curves)
    begin = min(c.start for c in curves)
    end = max(c.start + c.time_step * (len(c.acceleration) - 1) for c in curves)
    time = begin + np.arange(round((end - begin) / step) + 1) * step
    motions = []
    for c in curves:
        own = c.start + np.arange(len(c.acceleration)) * c.time_step
        signals = (c.acceleration, *integrate(c.acceleration, c.time_step))
        motions.append([np.interp(time, own, s, left=np.nan, right=np.nan) for s in signals])
    panels = tuple(
        Panel(
            label,
            time,
            tuple(
                ChartSeries(c.label, scale * motion[k], colour)
                for c, motion, colour in zip(curves, motions, CURVES, strict=False)
            ),
        )
        for k, (label, scale) in enumerate(QUANTITIES)
    )
    return Chart(name, "time [s]", panels, "The motion as recorded and as played")


def spectrum_chart(name: str, spectra: Mapping[str, tuple[Array, Array, Array]], damping: float) -> Chart:
    """Response spectra by label: periods [s], relative displacement [m], absolute acceleration [m/s²]."""
    periods = next(iter(spectra.values()))[0]
    curves = list(zip(spectra.items(), CURVES, strict=False))
    panels = (
        Panel("acceleration [m/s²]", periods, tuple(ChartSeries(n, s[2], c) for (n, s), c in curves), height=220),
        Panel("displacement [mm]", periods, tuple(ChartSeries(n, 1e3 * s[1], c) for (n, s), c in curves), height=150),
    )
    caption = f"Response spectrum at {100.0 * damping:g} % damping: absolute acceleration and relative displacement"
    return Chart(name, "period [s]", panels, caption, log_x=True)


def record_page(
    title: str,
    notes: Sequence[str],
    table: ResultTable,
    curves: Sequence[Curve],
    periods: Array,
    damping: float,
    command: str = "",
) -> Page:
    """What was done to a record, its peaks beside the table's limits, histories and spectra.

    Parameters
    ----------
    notes : what was changed, a sentence each.
    table : peaks as recorded, corrected and for the table, and limits.
    """
    page = Page("An accelerogram for the table", title, Made(command))
    page.heading("What was changed")
    for note in notes:
        page.paragraph(note)
    page.result(table)
    page.heading("The motion")
    page.chart(record_chart("motion", curves))
    page.heading("Response spectrum")
    spectra = {}
    for c in curves:
        found = response_spectrum(c.acceleration, c.time_step, 1.0 / periods, damping)
        spectra[c.label] = (periods, found.displacement, np.abs(found.acceleration))
    page.chart(spectrum_chart("spectrum", spectra, damping))
    return page


def response_chart(found: FrequencyResponse, highest: float, unit: str) -> Chart:
    """Gain ± two deviations, delay and coherence up to `highest` [Hz]; gain and delay on coherent lines."""
    shown = found.frequency <= highest
    good = shown & (found.coherence >= COHERENT)
    frequency, gain, spread = found.frequency[good], found.gain[good], 2.0 * found.deviation[good]
    ends = [
        ChartSeries(f"{sign} two deviations", gain * (1.0 + k * spread), "grey") for sign, k in (("−", -1), ("+", 1))
    ]
    panels = (
        Panel(f"gain [{unit}]", frequency, (*ends, ChartSeries("gain", gain, "after", width=1.6)), log=True),
        Panel("delay [ms]", frequency, (ChartSeries("delay", 1e3 * found.delay[good], "before"),), height=150),
        Panel(
            "coherence",
            found.frequency[shown],
            (ChartSeries("coherence", found.coherence[shown], "measured"),),
            height=120,
        ),
    )
    caption = "Gain with two standard deviations and delay on coherent lines, coherence on all"
    return Chart("response", "frequency [Hz]", panels, caption, log_x=True)


def response_page(title: str, table: ResultTable, chart: Chart, command: str = "") -> Page:
    """The table of the frequencies asked for, and the response on all lines."""
    page = Page("Frequency response", f"{title}.", Made(command))
    page.heading("What was found")
    page.result(table)
    page.heading("Over frequency")
    page.chart(chart)
    return page


def split_figure(title: str, split: MultisineSplit, unit: str, highest: float) -> Figure:
    """Amplitude of every line up to `highest` [Hz], by what stands on it."""
    figure = new_figure(10.0, 5.5)
    axis = figure.add_subplot()
    shown = split.frequency <= highest
    amplitude = np.maximum(np.abs(split.response), 1e-12)
    kinds = (
        (split.excited, COLOURS[0], "o", "excited lines: linear part with odd distortion"),
        (~split.odd & ~split.excited, COLOURS[2], "v", "even lines left out: even distortion"),
        (split.odd & ~split.excited, COLOURS[1], "^", "odd lines left out: odd distortion"),
    )
    for chosen, colour, marker, label in kinds:
        at = shown & chosen
        if np.any(at):
            axis.plot(split.frequency[at], amplitude[at], marker, color=colour, markersize=4, label=label)
    if np.any(np.isfinite(split.noise)):
        axis.plot(split.frequency[shown], split.noise[shown], color=GREY, linewidth=0.8, label="noise (standard dev.)")
    axis.set_yscale("log")
    tidy(axis, "frequency [Hz]", f"amplitude of a line [{unit}]")
    axis.legend(loc="upper right", fontsize="small")
    figure.suptitle(title, fontsize="medium")
    return figure
