"""The page of a drive-file iteration: error run by run, and the response spectra."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.core.loop.metrics import FREQUENCIES, HIGHEST, LOWEST
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel
from shake_ros.report.page import Made, Page
from shake_ros.report.text import percent


def error_chart(runs: Sequence[str], curves: Sequence[tuple[str, Sequence[float], str]]) -> Chart:
    """Errors run by run; curves : label, error of each run [-], colour."""
    number = np.arange(1, len(runs) + 1, dtype=np.float64)
    series = tuple(
        ChartSeries(label, 100.0 * np.asarray(values, dtype=np.float64), colour, kind="marks")
        for label, values, colour in curves
    )
    ticks = dict(zip(number.tolist(), runs, strict=True))
    view = (0.5, len(runs) + 0.5)
    panel = Panel("error [%]", number, series, height=210)
    return Chart("errors", "run", (panel,), "Error of the runs in their order", view=view, ticks=ticks)


def spectrum_chart(wanted: Array, spectra: Sequence[Array], best: int) -> Chart:
    """Response spectra [m/s²] as of `loop.metrics.spectrum_of`: wanted, of the first run and of the best."""
    frequencies = np.geomspace(LOWEST, HIGHEST, FREQUENCIES)
    series = [ChartSeries("wanted", wanted, "measured", width=2.4)]
    if best:
        series.append(ChartSeries("run 1", spectra[0], "before"))
    series.append(ChartSeries(f"run {best + 1}, the best", spectra[best], "after"))
    panel = Panel("response [m/s²]", frequencies, tuple(series), height=230)
    caption = "Response spectrum at 5 % damping: largest acceleration of an oscillator of each frequency"
    return Chart("spectra", "frequency [Hz]", (panel,), caption, log_x=True)


def iteration_page(
    runs: Sequence[str],
    missed: Sequence[float],
    charts: Sequence[Chart],
    true: Sequence[float] = (),
    reason: str = "",
    command: str = "",
) -> Page:
    """The runs and what each missed.

    Parameters
    ----------
    missed : error of each run's measured acceleration within the band [-]. true : that of the true acceleration, where
    the runs were simulated.
    """
    best = int(np.argmin(missed))
    page = Page("The drive, run by run", "Each run is corrected by what the last one missed.", Made(command))
    page.heading("What was found")
    page.cards(
        [
            (f"{percent(missed[0])} → {percent(missed[best])}", f"error within the band, {runs[0]} and {runs[best]}"),
            (runs[best], f"the best of {len(runs)} run{'s' * (len(runs) > 1)}, by the error within the band"),
        ]
    )
    if reason:
        page.paragraph(f"It ended because: {reason}.")
    page.heading("Errors, run by run")
    page.paragraph("The acceleration missed, rms over that of the wanted one.")
    head = ["run", "measured, within the band", *(["true, all frequencies"] if true else [])]
    rows = [
        [name, percent(m), *([percent(true[k])] if true else [])]
        for k, (name, m) in enumerate(zip(runs, missed, strict=True))
    ]
    page.table(head, rows, best=best)
    for chart in charts:
        page.chart(chart)
    return page
