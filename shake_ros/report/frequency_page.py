"""The page of a frequency response: gain, delay and coherence over frequency."""

from __future__ import annotations

from collections.abc import Sequence

from shake_ros.core.analysis.frequency_response import COHERENT, FrequencyResponse
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Made, Page


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


def response_page(
    title: str, rows: Sequence[tuple[float, float, float, float]], chart: Chart, unit: str, command: str = ""
) -> Page:
    """The table of the frequencies asked for, and the response on all lines."""
    page = Page("Frequency response", f"{title}.", Made(command))
    page.heading("What was found")
    head = ["frequency [Hz]", f"gain [{unit}]", "delay [ms]", "coherence"]
    page.table(head, [[f"{f:g}", f"{g:.4g}", f"{1e3 * d:.2f}", f"{c:.4f}"] for f, g, d, c in rows])
    page.heading("Over frequency")
    page.chart(chart)
    return page
