"""The static copy of a chart, for a paper, a notebook or a printed page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from shake_ros.core.quantities import unknown_name
from shake_ros.report.chart import FORMATS, Chart
from shake_ros.report.style import COLOUR, GREY, MEASURED, new_figure, tidy

POINT = 0.72  # of a line's width in pixels [point]
UNDATED = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": None}


def static_figure(chart: Chart, width: float = 9.5) -> Figure:
    """The chart at its first view; width [inch]."""
    heights = [p.height for p in chart.panels]
    figure = new_figure(width, 0.5 + sum(heights) / 80.0)
    rows = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for axes, panel in zip(rows, chart.panels, strict=True):
        seen = np.ones(len(panel.x), dtype=bool)
        if chart.view:
            seen = (panel.x >= chart.view[0]) & (panel.x <= chart.view[1])
        for s in panel.series:
            marks = {"line": "-", "dashed": "--", "points": "o", "rings": "o", "marks": "o-"}[s.kind]
            axes.plot(
                panel.x[seen],
                s.drawn[seen],
                marks,
                color=COLOUR[s.colour],
                linewidth=POINT * s.width,
                markersize=8.0 if s.kind == "rings" else 4.5,
                markerfacecolor="none" if s.kind == "rings" else None,
                label=s.label,
            )
        if panel.band:
            upper, lower = (panel.series[i].drawn[seen] for i in panel.band)
            axes.fill_between(panel.x[seen], lower, upper, color=MEASURED, alpha=0.12, linewidth=0.0)
        if panel.shaded:
            axes.axhspan(*panel.shaded, color=MEASURED, alpha=0.12, linewidth=0.0)
        for span in chart.shaded:
            axes.axvspan(*span, color=GREY, alpha=0.2, linewidth=0.0)
        if panel.log:
            axes.set_yscale("log")
        if chart.log_x:
            axes.set_xscale("log")
        if chart.ticks:
            axes.set_xticks(list(chart.ticks), list(chart.ticks.values()))
        tidy(axes, chart.x if axes is rows[-1] else "", panel.y)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, ncols=4, fontsize=8, borderaxespad=0.1)
    return figure


def save_figures(charts: Sequence[Chart], folder: Path, kind: str) -> None:
    """Write every chart into a folder as pdf, svg or png.

    Raises
    ------
    ShakeError
        A format that is none of these.
    """
    if kind not in FORMATS:
        raise unknown_name("format", kind, FORMATS, "--figures")
    folder.mkdir(parents=True, exist_ok=True)
    for chart in charts:
        figure = static_figure(chart)
        with rc_context({"svg.hashsalt": chart.name}):
            figure.savefig(folder / f"{chart.name}.{kind}", dpi=200, bbox_inches="tight", metadata=UNDATED[kind])
