"""Figure of a record before and after it was made fit for a table."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.analysis.response_spectrum import response_spectrum
from shake_ros.core.reference.baseline import integrate

Array = NDArray[np.float64]


class Curve(NamedTuple):
    """An acceleration to draw: its label, first instant [s], step [s] and values (n,) [m/s²]."""

    label: str
    start: float
    time_step: float
    acceleration: Array


def draw(path: Path, title: str, before: Curve, after: Curve, periods: Array, damping: float) -> None:
    """Write a PNG with acceleration, velocity, displacement and the response spectrum of both curves."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.6, 1.0))
    axes = [figure.add_subplot(grid[i, 0]) for i in range(3)]
    spectrum = figure.add_subplot(grid[:2, 1])
    displacement_spectrum = figure.add_subplot(grid[2, 1])
    for curve, colour in ((before, "0.6"), (after, "C0")):
        time = curve.start + np.arange(curve.acceleration.size) * curve.time_step
        velocity, displacement = integrate(curve.acceleration, curve.time_step)
        for axis, signal in zip(axes, (curve.acceleration, velocity, 1000.0 * displacement), strict=True):
            axis.plot(time, signal, color=colour, linewidth=0.8, label=curve.label)
        relative, _, absolute = response_spectrum(curve.acceleration, curve.time_step, periods, damping)
        spectrum.semilogx(periods, absolute, color=colour, label=curve.label)
        displacement_spectrum.semilogx(periods, 1000.0 * relative, color=colour)
    for axis, label in zip(axes, ("acceleration [m/s²]", "velocity [m/s]", "displacement [mm]"), strict=True):
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[0].legend(loc="upper right", fontsize="small")
    axes[2].set_xlabel("time [s]")
    spectrum.set_title(f"response spectrum, {100.0 * damping:g} % damping", fontsize="medium")
    spectrum.set_ylabel("absolute acceleration [m/s²]")
    displacement_spectrum.set_ylabel("relative displacement [mm]")
    displacement_spectrum.set_xlabel("period [s]")
    for axis in (spectrum, displacement_spectrum):
        axis.grid(alpha=0.3, which="both")
    figure.suptitle(title, fontsize="medium")
    figure.savefig(path, dpi=110, format="png")
