"""The page of the demo, and the demo in one picture: harmonics, acceleration and tracking, before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from shake_ros.core.control.closed_loop import normalised_error
from shake_ros.core.identification.recordings import Record
from shake_ros.data.recordings import TableRecording
from shake_ros.measured.models import MeasuredRuns
from shake_ros.measured.page import harmonics_chart
from shake_ros.report.chart import AFTER, BEFORE, MEASURED, new_figure, png, tidy
from shake_ros.report.charts_fit import fastest_segment, free_runs
from shake_ros.report.close_loop_page import MODELS, model_sections, step_text
from shake_ros.report.page import Bar, Page
from shake_ros.report.result_table import percent
from shake_ros.report.sections import Track, made_of, parameters_side_by_side, tracking_section
from shake_ros.report.text import sentence
from shake_ros.search.close_loop import LoopClosure


@dataclass(frozen=True)
class DemoResult:
    """What the demo found.

    Attributes
    ----------
    runs : of the real table, with the models fitted to them.
    hidden : name of the hidden effect.
    result : models before and after, with their errors on test data too.
    learn, hold, test : estimation, validation and test data.
    tracks : the earthquake with the declared and with the extended model in observer and controller, by name.
    """

    runs: MeasuredRuns
    hidden: str
    result: LoopClosure
    learn: Sequence[Record]
    hold: Sequence[Record]
    test: Sequence[Record]
    tracks: Mapping[str, Track]


def track_of(run: TableRecording) -> Track:
    """The true motion of a recording, and its relative errors behind the reference."""
    assert run.reference is not None and run.truth is not None
    good = np.isfinite(run.reference).all(axis=1) & np.isfinite(run.truth).all(axis=1)
    errors = normalised_error(run.reference[good], run.truth[good]).tolist()
    names = ("position", "velocity", "acceleration")
    return Track(run.time, run.reference, run.truth, dict(zip(names, errors, strict=True)))


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


def overview(found: DemoResult) -> bytes:
    """One picture of the whole result as PNG: harmonics, acceleration of the validation data, tracking error."""
    runs, result = found.runs, found.result
    figure = new_figure(12.5, 7.2)
    grid = figure.add_gridspec(2, 2)
    bars = figure.add_subplot(grid[0, 0])
    harmonic_axes(bars, runs, 0)
    bars.set_ylabel("acceleration amplitude [m/s²]")
    bars.set_title(
        f"real table, u = {runs.problem.runs[0].amplitude:g} at {runs.problem.runs[0].frequency:g} Hz", fontsize=10
    )
    bars.legend(frameon=False, fontsize=9)
    record = found.hold[0]
    runs_of_record = free_runs(record, result.baseline.table, result.final.table)
    span = fastest_segment(record, 1.2)
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
    tracking_axes(error, found.tracks)
    error.legend(frameon=False, loc="upper right", fontsize=9)
    return png(figure)


def measured_section(page: Page, runs: MeasuredRuns) -> None:
    """The five measured runs of the real table."""
    page.heading("Five measured runs of the real table")
    page.paragraph(
        f"{len(runs.problem.measured)} harmonic amplitudes of the acceleration under open-loop sines. The declared "
        f"model (constant bulk modulus) misses them by {runs.declared.rms:.3f} m/s² rms; "
        + (
            f"with {runs.best.name}, by {runs.best.rms:.3f} m/s²."
            if runs.best.name
            else "no extension justifies its extra parameters."
        )
    )
    best = f"with {runs.best.name or 'nothing added'}"
    drawn = [("declared model", runs.amplitudes(runs.declared), "before"), (best, runs.amplitudes(runs.best), "after")]
    page.chart(harmonics_chart(runs.problem, drawn))
    models = [runs.declared, *runs.variants]
    widest = max(v.rms for v in models)
    rows: list[list[str | Bar]] = [
        [v.name or "declared model", Bar(v.rms / widest, f"{v.rms:.3f}"), str(len(v.fit.x)), f"{v.criterion:.1f}"]
        for v in models
    ]
    head = ("model", "rms error [m/s²]", "parameters", "information criterion")
    page.table(head, rows, best=models.index(runs.best), start=0)


def demo_page(found: DemoResult, summary: Mapping[str, Any], command: str = "") -> Page:
    """The whole page; summary : content of summary.json."""
    runs, result, sets = found.runs, found.result, (found.learn, found.hold, found.test)
    before, after = (track.errors["position"] for track in found.tracks.values())
    named = summary["hidden"]["named"] or "nothing"
    page = Page(
        "Closing the loop with measured data",
        "A simulated table with an effect that the model is missing: recorded over DDS, found from the recordings, "
        "added, and tracked again; and the declared model against harmonics measured on the real table.",
        made_of(command, *sets),
    )
    page.heading("What was found, and how certain it is")
    page.cards(
        [
            (named, f"found from the recordings; the hidden effect was {found.hidden}"),
            (
                f"{percent(summary['hidden']['hold_before'])} → {percent(summary['hidden']['hold_after'])}",
                "acceleration error of the free run, validation data",
            ),
            (
                f"{percent(summary['hidden']['test_before'])} → {percent(summary['hidden']['test_after'])}",
                "acceleration error of the free run, test data",
            ),
            (
                f"{percent(before)} → {percent(after)}",
                "position error under the earthquake",
            ),
            (
                f"{runs.declared.rms:.3f} → {runs.best.rms:.3f} m/s²",
                f"error of the real table's harmonics, with {runs.best.name}",
            ),
        ]
    )
    for step, model in zip(result.search.steps, result.models, strict=True):
        page.paragraph(step_text(step, model))
    page.paragraph(
        "Plant, reference generator, observer, controller and recorder ran in lock-step as separate processes: "
        f"{sum(len(r.commands) for r in found.learn)} samples of an excitation for estimation and "
        f"{len(found.tracks[MODELS[0]].time)} samples of the earthquake for validation. The earthquake under the "
        "extended model is test data: no decision used it."
    )
    model_sections(page, result, *sets)
    page.heading("What remains")
    page.paragraph(sentence(result.remaining.text))
    page.heading("The same earthquake, tracked with each model")
    page.paragraph(
        "Observer and controller carry a copy of the table's model: in the first run the declared model, in the second "
        "the model identified and extended from the recordings. Errors are those of the true motion against the "
        "reference."
    )
    tracking_section(page, found.tracks)
    page.heading("Parameters")
    parameters_side_by_side(page, dict(zip(MODELS, (result.baseline, result.final), strict=True)))
    measured_section(page, runs)
    return page
