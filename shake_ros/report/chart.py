"""A chart of a report, described once: the page draws it with uPlot, a static copy with matplotlib."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
FORMATS = ("pdf", "svg", "png")  # of static copies
PLAIN = 256  # values up to which an array is written as numbers, not as 16 bit
STEPS = 65534  # of a packed array from its least to its largest value
MISSING = -32768


@dataclass(frozen=True)
class ChartSeries:
    """A curve: `values`, less `minus` where given, each of shape (n,).

    colour : a name of `style.COLOUR`. kind : line, dashed, points, rings, or marks on a line.
    width : of the line [pixel].
    """

    label: str
    values: Array
    colour: str
    minus: Array | None = None
    kind: str = "line"
    width: float = 1.2

    @property
    def drawn(self) -> Array:
        """The values that are seen, shape (n,)."""
        return self.values if self.minus is None else self.values - self.minus


@dataclass(frozen=True)
class Panel:
    """Curves over one abscissa, x of shape (n,).

    y : label with unit. height : [pixel]. shaded : (from, to) in y. band : places in `series` of two curves that
    enclose a shaded band, the upper one first.
    """

    y: str
    x: Array
    series: tuple[ChartSeries, ...]
    log: bool = False
    height: int = 190
    shaded: tuple[float, float] | None = None
    band: tuple[int, int] | None = None


@dataclass(frozen=True)
class Chart:
    """Panels one above the other, whose abscissas move together.

    Attributes
    ----------
    name : of its CSV file and its static copy.
    x : label of the abscissa with unit.
    caption : what is seen.
    view : (from, to) of the abscissa at first, None for all.
    ticks : names of places on the abscissa.
    shaded : intervals of the abscissa.
    """

    name: str
    x: str
    panels: tuple[Panel, ...]
    caption: str
    log_x: bool = False
    view: tuple[float, float] | None = None
    ticks: Mapping[float, str] = field(default_factory=dict)
    shaded: tuple[tuple[float, float], ...] = ()

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
