"""Figures of the measured runs: harmonics as bars, and a period of each model's acceleration."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.measured_harmonics.account import measured_distortion
from shake_ros.core.measured_harmonics.comparison import HarmonicComparison, MeasuredModel
from shake_ros.core.measured_harmonics.harmonics import HarmonicRun
from shake_ros.report.style import AFTER, BEFORE, MEASURED, new_figure, tidy

PRINTED = ("#c9d2dc", "#e0a899", BEFORE)  # of the printed models, the last one counts
LOWEST_SHOWN = 0.02  # [m/s²]
HIGHEST_SHOWN = 2.0  # of the largest measured amplitude
WIDTH = 0.8  # of all bars of an order


def title(run: HarmonicRun) -> str:
    """A run's command."""
    return f"u = {run.amplitude:g} sin(2π {run.frequency:g} t)"


def shown(comparison: HarmonicComparison) -> list[tuple[MeasuredModel, str]]:
    """The models drawn with their colours: the printed ones and the best fitted one."""
    colours = PRINTED[-len(comparison.printed) :]
    return [*zip(comparison.printed, colours, strict=True), (comparison.chosen, AFTER)]


def harmonics_figure(comparison: HarmonicComparison) -> Figure:
    """Amplitudes of every run: measured, with printed parameters, after the fit; THD below the title."""
    problem, models = comparison.problem, shown(comparison)
    figure = new_figure(14.0, 4.2)
    row = np.atleast_1d(
        figure.subplots(1, len(problem.runs), sharey=True, width_ratios=[len(r.orders) + 1 for r in problem.runs])
    )
    distortion = measured_distortion(problem)
    for i, (axes, run, span) in enumerate(zip(row, problem.runs, problem.spans, strict=True)):
        curves = [(run.measured, MEASURED, "measured on the table")]
        curves += [(m.account.amplitudes[span], colour, m.name) for m, colour in models]
        width = WIDTH / len(curves)
        place = np.arange(len(run.orders))
        for j, (values, colour, label) in enumerate(curves):
            offset = (j - 0.5 * (len(curves) - 1)) * width
            axes.bar(place + offset, values, width, color=colour, label=label)
        axes.set_xticks(place, [str(k) for k in run.orders])
        axes.set_yscale("log")
        axes.set_ylim(LOWEST_SHOWN, HIGHEST_SHOWN * problem.measured.max())
        thd = [distortion[i], *(m.account.distortion[i] for m, _ in models)]
        axes.set_title(title(run) + "\nTHD " + ", ".join(f"{100 * d:.0f}" for d in thd) + " %", fontsize=9)
        tidy(axes, "harmonic", "")
    row[0].set_ylabel("acceleration amplitude [m/s²]")
    figure.legend(*row[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(models) + 1, frameon=False)
    return figure


def traces_figure(comparison: HarmonicComparison) -> Figure:
    """One period of the acceleration of every run; phases are not printed, so there is no measured curve."""
    problem = comparison.problem
    figure = new_figure(14.0, 3.4)
    row = np.atleast_1d(figure.subplots(1, len(problem.runs)))
    for i, (axes, run) in enumerate(zip(row, problem.runs, strict=True)):
        samples = round(1.0 / (run.frequency * problem.sample_time))
        time = 1e3 * np.arange(samples) * problem.sample_time
        for model, colour in shown(comparison):
            axes.plot(time, model.account.traces[i][:samples], color=colour, linewidth=1.2, label=model.name)
        axes.set_title(title(run), fontsize=9)
        tidy(axes, "time from the command's peak [ms]", "")
    row[0].set_ylabel("acceleration [m/s²]")
    figure.legend(*row[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure
