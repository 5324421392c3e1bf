"""Figures for a paper, a notebook or a printed page: how they look, static copies of charts, recordings over time."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from shake_ros.core.quantities import unknown_name
from shake_ros.data.recordings import TableRecording
from shake_ros.report.chart import FORMATS, Chart

MEASURED, BEFORE, AFTER = "#1d2733", "#c8553d", "#2a7f62"
COLOURS = ("#1d4e89", "#c8553d", "#2a7f62", "#b8860b", "#6a4c93", "#5b6770")
"""Of curves that are equals."""
GREY = "#9aa5b1"
GRID = "#e3e8ee"
COLOUR = {
    "measured": MEASURED,
    "before": BEFORE,
    "after": AFTER,
    "grey": GREY,
    **{f"c{k}": colour for k, colour in enumerate(COLOURS)},
}
"""Of the curves of a chart by name; the page has the same names in both themes (web/page.css)."""


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a size [inch]."""
    return Figure(figsize=(width, height), layout="constrained")


def tidy(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Labels, a light grid behind the curves, no box."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title, fontsize=10)
    axes.grid(True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def name_decades(axis: Axis) -> None:
    """1, 2 and 5 of each decade on a logarithmic axis, as plain numbers."""
    low, high = axis.get_view_interval()
    marks = [m * 10.0**k for k in range(-9, 10) for m in (1.0, 2.0, 5.0) if low <= m * 10.0**k <= high]
    axis.set_minor_formatter(NullFormatter())
    axis.set_ticks(marks, [f"{m:g}" for m in marks])


def png(figure: Figure) -> bytes:
    """A figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, bbox_inches="tight")
    return buffer.getvalue()


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


CHANNELS = (("valve_command", "command [-]", 1.0), ("position", "position [mm]", 1e3))
REFERENCE = {"position": 0, "acceleration": 2}  # column of a reference
ACCELERATION = ("acceleration", "acceleration [m/s²]", 1.0)


def recordings_figure(recordings: Sequence[TableRecording]) -> Figure:
    """A column for each recording, a row for each signal."""
    channels = [*CHANNELS, *([ACCELERATION] if any(r.acceleration is not None for r in recordings) else [])]
    figure = new_figure(5.0 + 4.5 * (len(recordings) - 1), 2.2 * len(channels))
    grid = figure.subplots(len(channels), len(recordings), squeeze=False, sharex="col", sharey="row")
    for column, recording in enumerate(recordings):
        grid[0, column].set_title(recording.name)
        for row, (signal, label, scale) in enumerate(channels):
            axes, values = grid[row, column], getattr(recording, signal)
            if signal in REFERENCE and recording.reference is not None:
                wanted = scale * recording.reference[:, REFERENCE[signal]]
                axes.plot(recording.time, wanted, color=BEFORE, linewidth=0.8, label="reference")
            if values is not None:
                axes.plot(recording.time, scale * values, color=MEASURED, linewidth=0.8)
            tidy(axes, "time [s]" if row == len(channels) - 1 else "", label if column == 0 else "")
    return figure
