"""Figure of a record before and after it was made fit for a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shake_ros.core.analysis.response_spectrum import response_spectrum
from shake_ros.core.reference.baseline import integrate
from shake_ros.report.style import COLOURS, GREY, new_figure, tidy

Array = NDArray[np.float64]


class Curve(NamedTuple):
    """An acceleration to draw: its label, first instant [s], step [s] and values (n,) [m/s²]."""

    label: str
    start: float
    time_step: float
    acceleration: Array


def record_figure(title: str, before: Curve, after: Curve, periods: Array, damping: float) -> Figure:
    """Acceleration, velocity, displacement and the response spectrum of both curves."""
    figure = new_figure(11.0, 8.0)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.6, 1.0))
    axes = [figure.add_subplot(grid[i, 0]) for i in range(3)]
    spectrum = figure.add_subplot(grid[:2, 1])
    displacement_spectrum = figure.add_subplot(grid[2, 1])
    for curve, colour in ((before, GREY), (after, COLOURS[0])):
        time = curve.start + np.arange(curve.acceleration.size) * curve.time_step
        velocity, displacement = integrate(curve.acceleration, curve.time_step)
        for axis, signal in zip(axes, (curve.acceleration, velocity, 1000.0 * displacement), strict=True):
            axis.plot(time, signal, color=colour, linewidth=0.8, label=curve.label)
        relative, _, absolute = response_spectrum(curve.acceleration, curve.time_step, periods, damping)
        _draw_spectrum(spectrum, displacement_spectrum, periods, relative, absolute, colour, curve.label)
    for axis, label in zip(axes, ("acceleration [m/s²]", "velocity [m/s]", "displacement [mm]"), strict=True):
        tidy(axis, "time [s]" if axis is axes[2] else "", label)
    axes[0].legend(loc="upper right", fontsize="small", frameon=False)
    _label_spectrum(spectrum, displacement_spectrum, damping)
    figure.suptitle(title, fontsize="medium")
    return figure


def spectrum_figure(spectra: Mapping[str, tuple[Array, Array, Array]], damping: float) -> Figure:
    """Response spectra by name: periods [s], relative displacement [m], absolute acceleration [m/s²]."""
    figure = new_figure(7.0, 6.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    for name, (periods, relative, absolute) in spectra.items():
        _draw_spectrum(upper, lower, periods, relative, absolute, None, name)
    _label_spectrum(upper, lower, damping)
    upper.legend(loc="upper right", fontsize="small", frameon=False)
    return figure


def _draw_spectrum(
    upper: Axes, lower: Axes, periods: Array, relative: Array, absolute: Array, colour: str | None, label: str
) -> None:
    upper.semilogx(periods, absolute, color=colour, label=label)
    lower.semilogx(periods, 1000.0 * relative, color=colour)


def _label_spectrum(upper: Axes, lower: Axes, damping: float) -> None:
    tidy(upper, "", "absolute acceleration [m/s²]", f"response spectrum, {100.0 * damping:g} % damping")
    tidy(lower, "period [s]", "relative displacement [mm]")
