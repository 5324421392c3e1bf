"""Figures 6.19–6.24: the motion and the acceleration's spectrum for several values of one parameter of (6.15)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.analysis.parameter_study import ParameterStudy
from shake_ros.report.style import COLOURS, new_figure, tidy

SYMBOLS = {"theta_5": ("θ₅", "Pa/m³"), "theta_6": ("θ₆", "m³/(s·Pa)"), "theta_7": ("θ₇", "")}
ROWS = (("position [m]", 0), ("velocity [m/s]", 1), ("acceleration [m/s²]", 2))
SHOWN_PERIODS = 3
HIGHEST_HARMONIC = 15
LOWEST_SHOWN = 1e-2  # [m/s²]


def label(study: ParameterStudy, value: float) -> str:
    """Legend of one run."""
    symbol, unit = SYMBOLS[study.name]
    return f"{symbol} = {value:g} {unit}".rstrip()


def motion_figure(study: ParameterStudy, frequency: float) -> Figure:
    """Figures 6.19, 6.21, 6.23: position, velocity and acceleration over the last periods."""
    figure = new_figure(9.0, 7.0)
    panels = figure.subplots(3, 1, sharex=True)
    shown = round(SHOWN_PERIODS / frequency / study.sample_time)
    t = np.arange(len(study.commands))[-shown:] * study.sample_time
    for axes, (name, column) in zip(np.ravel(panels), ROWS, strict=True):
        for i, value in enumerate(study.values):
            run = study.motion[i, -shown:, column]
            run = run - run.mean() if column == 0 else run
            axes.plot(t, run, color=COLOURS[i % len(COLOURS)], linewidth=1.4, label=label(study, float(value)))
        tidy(axes, "time [s]" if column == ROWS[-1][1] else "", name)
    np.ravel(panels)[0].legend(
        frameon=False, fontsize=9, ncols=len(study.values), loc="lower right", bbox_to_anchor=(1.0, 1.0)
    )
    return figure


def spectrum_figure(study: ParameterStudy, frequency: float, samples: int) -> Figure:
    """Figures 6.20, 6.22, 6.24: amplitudes of the acceleration over frequency."""
    figure = new_figure(9.0, 4.0)
    axes = figure.subplots()
    frequencies, amplitudes = study.spectrum(samples)
    harmonics = np.arange(1, HIGHEST_HARMONIC + 1)
    places = [int(np.argmin(np.abs(frequencies - k * frequency))) for k in harmonics]
    width = 0.8 / len(study.values)
    for i, value in enumerate(study.values):
        offset = (i - 0.5 * (len(study.values) - 1)) * width
        heights = amplitudes[i, places]
        axes.bar(harmonics + offset, heights, width, color=COLOURS[i % len(COLOURS)], label=label(study, float(value)))
    axes.set_xticks(harmonics, [f"{k * frequency:g}" for k in harmonics])
    axes.set_yscale("log")
    axes.set_ylim(bottom=LOWEST_SHOWN)
    axes.legend(frameon=False, fontsize=9)
    tidy(axes, "frequency [Hz]", "acceleration [m/s²]")
    return figure
