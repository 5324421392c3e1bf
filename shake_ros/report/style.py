"""How every figure looks: its colours, its axes, its file."""

from __future__ import annotations

import io

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

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
