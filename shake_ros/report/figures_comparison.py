"""Figures 6.61 and 6.62 for any controllers: errors of position and velocity over time, and their spectra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.loop.comparison import Summary
from shake_ros.report.style import COLOURS, MEASURED, new_figure, tidy

QUANTITIES = (("position", "mm", 1e3), ("velocity", "mm/s", 1e3))
HIGHEST_SHOWN = 30.0  # [Hz]
LOWEST_AMPLITUDE = 1e-4  # of the largest, below which a spectrum is not shown


def error_figure(runs: Mapping[str, ClosedLoop]) -> Figure:
    """Figure 6.61: position and velocity error of each controller over time."""
    figure = new_figure(9.5, 6.0)
    for (name, unit, scale), axes, column in zip(QUANTITIES, figure.subplots(2, 1, sharex=True), (0, 1), strict=True):
        for (label, run), colour in zip(runs.items(), COLOURS, strict=False):
            time = np.arange(len(run.command)) * run.sample_time
            error = scale * (run.truth[:, column] - run.reference[:, column])
            axes.plot(time, error, color=colour, linewidth=0.9, label=label)
        tidy(axes, "time [s]" if column else "", f"{name} error [{unit}]")
        if column == 0:
            axes.legend(frameon=False, fontsize=9, ncols=2, loc="upper right")
    return figure


def amplitudes(signal: NDArray[np.float64], sample_time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [Hz] and amplitudes of the signal's lines up to 30 Hz [unit of the signal]."""
    spectrum = 2.0 * np.abs(np.fft.rfft(signal - signal.mean())) / len(signal)
    frequency = np.asarray(np.fft.rfftfreq(len(signal), sample_time), dtype=np.float64)
    shown = (frequency > 0.0) & (frequency <= HIGHEST_SHOWN)
    return frequency[shown], spectrum[shown]


def _spectrum_axes(axes: Axes, runs: Mapping[str, ClosedLoop], column: int, scale: float) -> None:
    first = next(iter(runs.values()))
    frequency, wanted = amplitudes(scale * first.reference[:, column], first.sample_time)
    axes.plot(frequency, wanted, color=MEASURED, linewidth=1.8, label="reference")
    for (label, run), colour in zip(runs.items(), COLOURS, strict=False):
        if np.isfinite(run.truth).all():
            axes.plot(
                *amplitudes(scale * run.truth[:, column], run.sample_time), color=colour, linewidth=0.9, label=label
            )
    axes.set_yscale("log")
    axes.set_ylim(LOWEST_AMPLITUDE * wanted.max(), 2.0 * wanted.max())


def spectrum_figure(runs: Mapping[str, ClosedLoop]) -> Figure:
    """Figure 6.62: spectra of position and velocity of the reference and under each controller."""
    figure = new_figure(9.5, 6.0)
    for (name, unit, scale), axes, column in zip(QUANTITIES, figure.subplots(2, 1, sharex=True), (0, 1), strict=True):
        _spectrum_axes(axes, runs, column, scale)
        tidy(axes, "frequency [Hz]" if column else "", f"{name} amplitude [{unit}]")
        if column == 0:
            axes.legend(frameon=False, fontsize=9, ncols=2, loc="upper right")
    return figure


def error_bars(summaries: Sequence[Summary]) -> Figure:
    """Worst position, velocity and acceleration error of every controller, logarithmic."""
    figure = new_figure(9.5, 0.32 * len(summaries) + 1.4)
    panels = np.ravel(figure.subplots(1, 3, sharey=True))
    place = np.arange(len(summaries))[::-1]
    for axes, name in zip(panels, ("position", "velocity", "acceleration"), strict=True):
        values = [100.0 * getattr(s.worst, f"{name}_error") for s in summaries]
        axes.barh(place, values, color=COLOURS[0], height=0.62)
        axes.set_xscale("log")
        finite = [value for value in values if np.isfinite(value) and value > 0.0]
        if finite:
            axes.set_xlim(0.2 * min(finite), 3.0 * max(finite))
        axes.xaxis.set_minor_formatter(NullFormatter())
        tidy(axes, f"{name} error, worst case [%]", "")
    panels[0].set_yticks(place, [s.entry for s in summaries], fontsize=9)
    return figure
