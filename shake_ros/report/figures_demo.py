"""The demo in one picture: harmonics of a measured run, acceleration before and after, tracking before and after."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from shake_ros.core.discovery.close_loop import LoopClosure
from shake_ros.core.identification.recordings import Record
from shake_ros.core.measured_harmonics.variants import MeasuredRuns
from shake_ros.report.charts_fit import fastest_stretch, free_runs
from shake_ros.report.sections import Track
from shake_ros.report.style import AFTER, BEFORE, MEASURED, new_figure, png, tidy


def harmonic_axes(axes: Axes, runs: MeasuredRuns, index: int) -> None:
    """Bars of one measured run: measured, declared model, best variant."""
    run = runs.problem.runs[index]
    first = sum(len(r.orders) for r in runs.problem.runs[:index])
    span = slice(first, first + len(run.orders))
    curves = (
        (run.measured, MEASURED, "measured on the table"),
        (runs.amplitudes(runs.declared)[span], BEFORE, "declared model"),
        (runs.amplitudes(runs.best)[span], AFTER, f"with {runs.best.name or 'nothing added'}"),
    )
    place = np.arange(len(run.orders))
    for i, (values, colour, label) in enumerate(curves):
        axes.bar(place + (i - 1) * 0.27, values, width=0.25, color=colour, label=label)
    axes.set_xticks(place, [str(k) for k in run.orders])
    axes.set_yscale("log")
    axes.set_ylim(0.04, 20.0)
    axes.set_title(f"u = {run.amplitude:g} sin(2π {run.frequency:g} t)", fontsize=10)
    tidy(axes, "harmonic", "")


def tracking_axes(axes: Axes, tracks: Mapping[str, Track]) -> None:
    """Position error of the true motion over time."""
    for (label, track), colour in zip(tracks.items(), (BEFORE, AFTER), strict=True):
        error = 1e3 * (track.motion[:, 0] - track.reference[:, 0])
        axes.plot(track.time, error, color=colour, linewidth=1.0, label=label)
    tidy(axes, "time [s]", "position error [mm]")


def overview(runs: MeasuredRuns, result: LoopClosure, hold: list[Record], tracks: Mapping[str, Track]) -> bytes:
    """One picture of the whole result as PNG: harmonics, acceleration of the validation data, tracking error."""
    figure = new_figure(12.5, 7.2)
    grid = figure.add_gridspec(2, 2)
    bars = figure.add_subplot(grid[0, 0])
    harmonic_axes(bars, runs, 0)
    bars.set_ylabel("acceleration amplitude [m/s²]")
    bars.set_title(
        f"real table, u = {runs.problem.runs[0].amplitude:g} at {runs.problem.runs[0].frequency:g} Hz", fontsize=10
    )
    bars.legend(frameon=False, fontsize=9)
    record = hold[0]
    runs_of_record = free_runs(record, result.baseline.table, result.final.table)
    span = fastest_stretch(record, 1.2)
    time = np.arange(len(record.commands))[span] * record.sample_time
    history = figure.add_subplot(grid[0, 1])
    if record.acceleration is not None:
        history.plot(time, record.acceleration[span], color=MEASURED, linewidth=1.6, label="measured (validation)")
    history.plot(time, runs_of_record[0][span, 2], color=BEFORE, linewidth=1.1, label="declared model")
    named = ", ".join(s.chosen.candidate.effect for s in result.search.steps) or "nothing added"
    history.plot(time, runs_of_record[1][span, 2], color=AFTER, linewidth=1.1, linestyle="--", label=f"with {named}")
    tidy(history, "time [s]", "acceleration [m/s²]")
    history.legend(frameon=False, fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    error = figure.add_subplot(grid[1, :])
    tracking_axes(error, tracks)
    error.legend(frameon=False, loc="upper right", fontsize=9)
    return png(figure)
