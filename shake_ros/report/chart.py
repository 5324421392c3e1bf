"""A chart of a report, described once: drawn on the page by uPlot, for a paper by matplotlib; figures of recordings."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.quantities import unknown_name
from shake_ros.recordings.bags import TableRecording

if TYPE_CHECKING:  # loaded where a figure is drawn: it takes longer than all else
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure, FigureBase

Array = NDArray[np.floating[Any]]
FORMATS = ("pdf", "svg", "png")  # of static copies
PLAIN = 256  # values up to which an array is written as numbers, not as 16 bit
STEPS = 65534  # of a packed array from its least to its largest value
MISSING = -32768


@dataclass(frozen=True)
class ChartSeries:
    """A curve: `values`, less `minus` where given, each of shape (n,)."""

    label: str
    values: Array
    colour: str  # a name of `style.COLOUR`
    minus: Array | None = None
    kind: str = "line"  # line, dashed, points, rings, or marks on a line
    width: float = 1.2  # of the line [pixel]

    @property
    def drawn(self) -> Array:
        """The values that are seen, shape (n,)."""
        return self.values if self.minus is None else self.values - self.minus


@dataclass(frozen=True)
class Panel:
    """Curves over one abscissa, x of shape (n,)."""

    y: str  # label with unit
    x: Array
    series: tuple[ChartSeries, ...]
    log: bool = False
    height: int = 190  # [pixel]
    shaded: tuple[float, float] | None = None  # (from, to) in y
    # places in `series` of two curves that enclose a shaded band, the upper one first
    band: tuple[int, int] | None = None


@dataclass(frozen=True)
class Chart:
    """Panels one above the other, whose abscissas move together."""

    name: str  # of its CSV file and its static copy
    x: str  # label of the abscissa with unit
    panels: tuple[Panel, ...]
    caption: str  # what is seen
    log_x: bool = False
    view: tuple[float, float] | None = None  # (from, to) of the abscissa at first, None for all
    ticks: Mapping[float, str] = field(default_factory=dict)  # names of places on the abscissa
    shaded: tuple[tuple[float, float], ...] = ()  # intervals of the abscissa

    def thinned(self, block: int) -> Chart:
        """The least and the largest of every `block` samples of the long panels, so that no peak is lost."""
        panels = tuple(_thinned(p, block) for p in self.panels)
        if all(new is old for new, old in zip(panels, self.panels, strict=True)):
            return self
        note = f"{self.caption} (least and largest of every {block} samples)"
        return replace(self, panels=panels, caption=note)


def _thinned(panel: Panel, block: int) -> Panel:
    count = len(panel.x) // block
    if len(panel.x) <= 16 * PLAIN or count < 1:
        return panel

    def ends(values: Array) -> Array:
        rows = values[: count * block].reshape(count, block)
        rising = np.argmax(rows, axis=1) >= np.argmin(rows, axis=1)
        low, high = rows.min(axis=1), rows.max(axis=1)
        return np.column_stack([np.where(rising, low, high), np.where(rising, high, low)]).ravel()

    x = panel.x[: count * block].reshape(count, block)[:, [0, block // 2]].ravel()
    series = tuple(replace(s, values=ends(s.drawn), minus=None) for s in panel.series)
    return replace(panel, x=x, series=series)


def chart_json(chart: Chart) -> dict[str, Any]:
    """What the page's script draws: columns, each once, and the panels that show them."""
    columns: list[Any] = []
    known: dict[int, int] = {}

    def column(values: Array | None, log: bool = False) -> int | None:
        if values is None:
            return None
        if id(values) not in known:
            known[id(values)] = len(columns)
            columns.append(packed(np.where(values > 0.0, values, np.nan) if log else values))
        return known[id(values)]

    panels = [
        {
            "y": p.y,
            "x": column(p.x),
            "log": p.log,
            "height": p.height,
            "shaded": p.shaded,
            **({"band": p.band} if p.band else {}),
            "series": [
                {
                    "label": s.label,
                    "values": column(s.values, p.log),
                    "minus": column(s.minus),
                    "colour": s.colour,
                    "kind": s.kind,
                    "width": s.width,
                }
                for s in p.series
            ],
        }
        for p in chart.panels
    ]
    return {
        "name": chart.name,
        "x": chart.x,
        "log": chart.log_x,
        "view": chart.view,
        "ticks": {f"{at:g}": name for at, name in chart.ticks.items()},
        "shaded": chart.shaded,
        "panels": panels,
        "columns": columns,
    }


def packed(values: Array) -> Any:
    """An array as JSON: numbers, or start and step of a uniform one, or 16 bit over its range.

    >>> packed(np.array([0.5, np.nan])), packed(np.arange(1000) * 0.5)
    ([0.5, None], {'start': 0.0, 'step': 0.5, 'count': 1000})
    """
    if len(values) <= PLAIN:
        return [float(f"{v:.6g}") if np.isfinite(v) else None for v in values.tolist()]
    step = float(values[-1] - values[0]) / (len(values) - 1)
    if np.allclose(np.diff(values), step, rtol=1e-6, atol=0.0):
        return {"start": float(values[0]), "step": float(f"{step:.12g}"), "count": len(values)}
    good = np.isfinite(values)
    low, high = (float(values[good].min()), float(values[good].max())) if good.any() else (0.0, 0.0)
    unit = (high - low) / STEPS or 1.0
    steps = np.full(len(values), MISSING, dtype="<i2")
    steps[good] = np.round((values[good] - low) / unit) - STEPS // 2
    return {"low": low, "step": unit, "data": base64.b64encode(steps.tobytes()).decode()}


MEASURED, BEFORE, AFTER = "#1d2733", "#c8553d", "#2a7f62"
COLOURS = ("#1d4e89", "#c8553d", "#2a7f62", "#b8860b", "#6a4c93", "#5b6770")
"""Of curves that are equals."""
CURVES = ("c5", "c0", "c1", "c2", "c3", "c4")  # the same by name, for curves beside a first one
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
    from matplotlib.figure import Figure

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
    """1, 2 and 5 of each decade on a logarithmic axis of three or less, as plain numbers."""
    from matplotlib.ticker import NullFormatter

    low, high = axis.get_view_interval()
    if high > 1e3 * low:
        return
    marks = [m * 10.0**k for k in range(-9, 10) for m in (1.0, 2.0, 5.0) if low <= m * 10.0**k <= high]
    axis.set_minor_formatter(NullFormatter())
    axis.set_ticks(marks, [f"{m:g}" for m in marks])


POINT = 0.72  # of a line's width in pixels [point]
UNDATED = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": None}


def static_figure(*charts: Chart) -> Figure:
    """Charts at their first view, one below the other."""
    heights = [0.5 + sum(p.height for p in chart.panels) / 80.0 for chart in charts]
    figure = new_figure(9.5, sum(heights))
    parts = figure.subfigures(len(charts), 1, squeeze=False, height_ratios=heights)
    for chart, part in zip(charts, parts[:, 0], strict=True):
        draw(chart, part)
    return figure


def draw(chart: Chart, figure: FigureBase) -> None:
    """Draw the chart at its first view into a figure, or into a part of one."""
    heights = [p.height for p in chart.panels]
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
            name_decades(axes.yaxis)
        if chart.log_x:
            axes.set_xscale("log")
            name_decades(axes.xaxis)
        if chart.ticks:
            axes.set_xticks(list(chart.ticks), list(chart.ticks.values()))
        tidy(axes, chart.x if axes is rows[-1] else "", panel.y)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, ncols=4, fontsize=8, borderaxespad=0.1)


def save_figures(charts: Sequence[Chart], folder: Path, kind: str) -> None:
    """Write every chart into a folder as pdf, svg or png.

    Raises
    ------
    ShakeError
        A format that is none of these.
    """
    from matplotlib import rc_context

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
