"""Figures of the reproduction: motions over each other, errors over frequency, a network's training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shake_ros.report.style import COLOURS, MEASURED, new_figure, tidy

Array = NDArray[np.float64]
CHANNELS = ("velocity", "acceleration")
UNITS = {"velocity": "m/s", "acceleration": "m/s²"}


def motions(time: Array, runs: Mapping[str, tuple[Array, Array]]) -> Figure:
    """Velocity above, acceleration below; the first run is drawn as what the others should be.

    Parameters
    ----------
    time : (n,) [s]. runs : velocity [m/s] and acceleration [m/s²], each (n,), by name.
    """
    figure = new_figure(9.5, 5.0)
    for k, (axes, channel) in enumerate(zip(np.ravel(figure.subplots(2, 1, sharex=True)), CHANNELS, strict=True)):
        for (name, run), colour in zip(runs.items(), (MEASURED, *COLOURS[1:]), strict=False):
            wide = 2.0 if colour == MEASURED else 1.1
            axes.plot(time, run[k], color=colour, linewidth=wide, label=name)
        tidy(axes, "time [s]" if k else "", f"{channel} [{UNITS[channel]}]")
        if not k:
            axes.legend(frameon=False, fontsize=9, ncols=len(runs), loc="lower right", bbox_to_anchor=(1.0, 1.0))
    return figure


def over_frequency(frequencies: Sequence[float], errors: Mapping[str, Mapping[str, Sequence[float]]]) -> Figure:
    """Relative error of velocity and acceleration over frequency, one curve for each model."""
    figure = new_figure(9.5, 3.8)
    for axes, channel in zip(np.ravel(figure.subplots(1, 2)), CHANNELS, strict=True):
        for (name, found), colour in zip(errors.items(), COLOURS, strict=False):
            axes.semilogy(frequencies, 100.0 * np.array(found[channel]), "o-", color=colour, markersize=3, label=name)
        tidy(axes, "frequency [Hz]", f"error of the {channel} [%]")
    axes.legend(frameon=False, fontsize=9)
    return figure
