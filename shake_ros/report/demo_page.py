"""The page of the demo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from shake_ros.core.discovery.close_loop import LoopClosure
from shake_ros.core.identification.recordings import Record
from shake_ros.core.measured_harmonics.variants import MeasuredRuns
from shake_ros.data.recordings import TableRecording
from shake_ros.report.charts_harmonics import harmonics_chart
from shake_ros.report.close_loop_page import MODELS, model_sections, step_text
from shake_ros.report.page import Bar, Page
from shake_ros.report.sections import Track, made_of, parameter_table, tracking_section
from shake_ros.report.text import percent, sentence


@dataclass(frozen=True)
class Tracking:
    """The same earthquake with the declared and with the extended model inside observer and controller."""

    before: TableRecording
    after: TableRecording
    error_before: Mapping[str, float]
    error_after: Mapping[str, float]


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


def tracks_of(tracking: Tracking) -> dict[str, Track]:
    """The true motions as the figures take them."""
    tracks = {}
    for name, run, errors in (
        ("declared model", tracking.before, tracking.error_before),
        ("extended model", tracking.after, tracking.error_after),
    ):
        assert run.reference is not None and run.truth is not None
        tracks[name] = Track(run.time, run.reference, run.truth, errors)
    return tracks


def demo_page(
    runs: MeasuredRuns,
    hidden: str,
    result: LoopClosure,
    learn: Sequence[Record],
    hold: Sequence[Record],
    test: Sequence[Record],
    tracks: Tracking,
    summary: Mapping[str, Any],
    command: str = "",
) -> Page:
    """The whole page."""
    named = summary["hidden"]["named"] or "nothing"
    page = Page(
        "Closing the loop with measured data",
        "A simulated table with an effect that the model is missing: recorded over DDS, found from the recording, "
        "added, and tracked again; and the declared model against harmonics measured on the real table.",
        made_of(command, learn, hold, test),
    )
    page.heading("What was found, and how sure")
    page.cards(
        [
            (named, f"found from the recording; the hidden effect was {hidden}"),
            (
                f"{percent(summary['hidden']['hold_before'])} → {percent(summary['hidden']['hold_after'])}",
                "acceleration error of the free run, validation data",
            ),
            (
                f"{percent(summary['hidden']['test_before'])} → {percent(summary['hidden']['test_after'])}",
                "acceleration error of the free run, test data",
            ),
            (
                f"{percent(tracks.error_before['position'])} → {percent(tracks.error_after['position'])}",
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
        f"{sum(len(r.commands) for r in learn)} samples of an excitation for estimation and "
        f"{len(tracks.before.time)} samples of the earthquake for validation. The earthquake under the extended model "
        "is test data: no decision knew it."
    )
    model_sections(page, result, learn, hold, test)
    page.heading("What remains")
    page.paragraph(sentence(result.remaining.text))
    page.heading("The same earthquake, tracked with each model")
    page.paragraph(
        "Observer and controller carry a copy of the table's model: in the first run the declared model, in the second "
        "the model identified and extended from the recordings. Errors are those of the true motion against the "
        "reference."
    )
    tracking_section(page, tracks_of(tracks))
    page.heading("Parameters")
    parameter_table(page, dict(zip(MODELS, (result.baseline, result.final), strict=True)))
    measured_section(page, runs)
    return page
