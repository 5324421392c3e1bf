"""Figures of a residual: its correlation with its past and with the drive, and the correlation of the estimates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.identification.diagnosis import Judgement
from shake_ros.core.identification.identifiability import Identifiability
from shake_ros.report.style import AFTER, BEFORE, MEASURED, new_figure, tidy


def correlogram(judgements: Sequence[Judgement]) -> Figure:
    """Autocorrelation and cross-correlation with the drive over ±25 lags, with the bounds of a single lag at 99 %."""
    tested = [(j, j.test) for j in judgements if j.test is not None]
    figure = new_figure(9.5, 1.9 * max(len(tested), 1))
    rows = figure.subplots(max(len(tested), 1), 2, squeeze=False, sharex="col")
    for (left, right), (judgement, test) in zip(rows, tested, strict=True):
        lags = len(test.autocorrelation) - 1
        shown = (
            (left, np.arange(1, lags + 1), test.autocorrelation[1:], test.auto_bound, test.white),
            (right, np.arange(-lags, lags + 1), test.cross_correlation, test.cross_bound, test.independent),
        )
        for axes, lag, value, bound, passed in shown:
            axes.axhspan(-bound, bound, color=MEASURED, alpha=0.12, linewidth=0.0)
            axes.vlines(lag, 0.0, value, color=AFTER if passed else BEFORE, linewidth=2.0)
            axes.axhline(0.0, color=MEASURED, linewidth=0.6)
            tidy(axes, "", "")
        left.set_ylabel(f"{judgement.name}\n({'validation' if judgement.held_out else 'estimation'})")
    for axes, title in zip(rows[0], ("with its own past", "with the drive"), strict=True):
        axes.set_title(title, fontsize=10)
    for axes in rows[-1]:
        axes.set_xlabel("lag [samples]")
    return figure


def correlation_figure(known: Identifiability) -> Figure:
    """Correlation matrix of the estimates; blank where a parameter rests on a bound."""
    count = len(known.names)
    figure = new_figure(3.4 + 0.5 * count, 1.2 + 0.42 * count)
    axes = figure.subplots()
    picture = axes.imshow(known.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu_r")
    short = [name.removeprefix("effects.") for name in known.names]
    axes.set_xticks(range(count), short, rotation=40, ha="right", fontsize=8)
    axes.set_yticks(range(count), short, fontsize=8)
    for i, k in np.argwhere(np.isfinite(known.correlation)).tolist():
        value = float(known.correlation[i, k])
        axes.text(k, i, f"{value:.2f}", ha="center", va="center", fontsize=7, color="w" if abs(value) > 0.6 else "k")
    figure.colorbar(picture, ax=axes, shrink=0.8)
    return figure
