"""The page of a record before and after it was made fit for a table, and charts of response spectra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.analysis.response_spectrum import response_spectrum
from shake_ros.core.reference.baseline import integrate
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Made, Page

Array = NDArray[np.float64]
QUANTITIES = (("acceleration [m/s²]", 1.0), ("velocity [mm/s]", 1e3), ("displacement [mm]", 1e3))
COLOURS = ("c5", "c0", "c1", "c2", "c3", "c4")


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
                for c, motion, colour in zip(curves, motions, COLOURS, strict=False)
            ),
        )
        for k, (label, scale) in enumerate(QUANTITIES)
    )
    return Chart(name, "time [s]", panels, "The motion as recorded and as the table gets it")


def spectrum_chart(name: str, spectra: Mapping[str, tuple[Array, Array, Array]], damping: float) -> Chart:
    """Response spectra by label: periods [s], relative displacement [m], absolute acceleration [m/s²]."""
    periods = next(iter(spectra.values()))[0]
    curves = list(zip(spectra.items(), COLOURS, strict=False))
    panels = (
        Panel("acceleration [m/s²]", periods, tuple(ChartSeries(n, s[2], c) for (n, s), c in curves), height=220),
        Panel("displacement [mm]", periods, tuple(ChartSeries(n, 1e3 * s[1], c) for (n, s), c in curves), height=150),
    )
    caption = f"Response spectrum at {100.0 * damping:g} % damping: absolute acceleration and relative displacement"
    return Chart(name, "period [s]", panels, caption, log_x=True)


def record_page(
    title: str,
    notes: Sequence[str],
    rows: Sequence[Sequence[str]],
    curves: Sequence[Curve],
    periods: Array,
    damping: float,
    command: str = "",
) -> Page:
    """What was done to a record, its peaks beside the table's limits, histories and spectra.

    Parameters
    ----------
    notes : what was changed, a sentence each. rows : quantity, as recorded, corrected, for the table, limit.
    """
    page = Page("A record for the table", title, Made(command))
    page.heading("What was changed")
    for note in notes:
        page.paragraph(note)
    page.table(("peak", "as recorded", "corrected", "for the table", "limit"), rows)
    page.heading("The motion")
    page.chart(record_chart("motion", curves))
    page.heading("Response spectrum")
    spectra = {}
    for c in curves:
        found = response_spectrum(c.acceleration, c.time_step, 1.0 / periods, damping)
        spectra[c.label] = (periods, found.displacement, np.abs(found.acceleration))
    page.chart(spectrum_chart("spectrum", spectra, damping))
    return page
