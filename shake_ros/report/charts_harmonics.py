"""Charts of measured runs: harmonics measured and simulated, and a period of each model's acceleration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.core.measured_harmonics.comparison import HarmonicComparison, MeasuredModel
from shake_ros.core.measured_harmonics.harmonics import HarmonicProblem, HarmonicRun
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel

COLOURS = ("c5", "c3", "before")  # of the printed models, the last one counts


def title(run: HarmonicRun) -> str:
    """A run's command."""
    return f"u = {run.amplitude:g} sin(2π {run.frequency:g} t)"


def harmonics_chart(problem: HarmonicProblem, models: Sequence[tuple[str, Array, str]]) -> Chart:
    """Amplitudes of every run, measured and of each model given as name, amplitudes of all runs and colour."""
    panels, first = [], 0
    for run in problem.runs:
        span = slice(first, first + len(run.orders))
        first += len(run.orders)
        series = [
            ChartSeries(f"{title(run)}: measured", np.asarray(run.measured, dtype=np.float64), "measured", kind="rings")
        ]
        series += [ChartSeries(name, values[span], colour, kind="points") for name, values, colour in models]
        panels.append(Panel("[m/s²]", np.asarray(run.orders, dtype=np.float64), tuple(series), log=True, height=150))
    orders = sorted({int(k) for run in problem.runs for k in run.orders})
    caption = "Amplitude of the acceleration by harmonic, run by run, on a logarithmic scale; rings: measured"
    ticks = {float(k): str(k) for k in orders}
    return Chart("harmonics", "harmonic", tuple(panels), caption, view=(0.5, orders[-1] + 0.5), ticks=ticks)


def traces_chart(comparison: HarmonicComparison) -> Chart:
    """One period of the acceleration of every run; phases are not printed, so there is no measured curve."""
    problem, panels = comparison.problem, []
    for i, run in enumerate(problem.runs):
        samples = round(1.0 / (run.frequency * problem.sample_time))
        angle = np.arange(samples) / samples
        series = tuple(
            ChartSeries(f"{title(run)}: {m.name}" if k == 0 else m.name, m.account.traces[i][:samples], colour)
            for k, (m, colour) in enumerate(shown(comparison))
        )
        panels.append(Panel("[m/s²]", angle, series, height=130))
    caption = "One period of the simulated acceleration of every run (the thesis prints no phases to compare with)"
    return Chart("traces", "part of the period from the command's peak", tuple(panels), caption)


def shown(comparison: HarmonicComparison) -> list[tuple[MeasuredModel, str]]:
    """The models drawn with their colours: the printed ones and the best fitted one."""
    printed = comparison.printed
    colours = COLOURS[-len(printed) :] if printed else ()
    return [*zip(printed, colours, strict=True), (comparison.chosen, "after")]
