"""Figure of a multisine's response split into linear, even and odd nonlinear parts and noise."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.analysis.multisine_split import MultisineSplit
from shake_ros.report.style import COLOURS, GREY, new_figure, tidy


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
