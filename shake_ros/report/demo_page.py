"""The page of the demo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shake_ros.core.discovery.close_loop import LoopClosure
from shake_ros.core.identification.recordings import Record
from shake_ros.core.measured_harmonics.variants import MeasuredRuns
from shake_ros.data.recordings import TableRecording
from shake_ros.report import figures_demo
from shake_ros.report.close_loop_page import model_sections, percent
from shake_ros.report.page import Page


@dataclass(frozen=True)
class Tracking:
    """The same earthquake with the declared and with the extended model inside observer and controller."""

    before: TableRecording
    after: TableRecording
    error_before: Mapping[str, float]
    error_after: Mapping[str, float]


def measured_section(page: Page, runs: MeasuredRuns) -> None:
    """Step 1: the five measured runs."""
    page.heading("1  Five measured runs of the real table")
    page.paragraph(
        f"{len(runs.problem.measured)} harmonic amplitudes of the acceleration under open-loop sines. The declared "
        f"model (constant bulk modulus) leaves {runs.declared.rms:.3f} m/s² root mean square; "
        + (
            f"{runs.best.name} brings it to {runs.best.rms:.3f} m/s²."
            if runs.best.name
            else "no extension earns its parameters."
        )
    )
    page.figure(figures_demo.harmonics_figure(runs), "Measured and fitted amplitudes, logarithmic")
    models = [runs.declared, *runs.variants]
    rows = [[v.name or "declared model", f"{v.rms:.3f}", str(len(v.fit.x)), f"{v.criterion:.1f}"] for v in models]
    page.table(["model", "rms error [m/s²]", "parameters", "information criterion"], rows, best=models.index(runs.best))


def tracking_section(page: Page, tracks: Tracking) -> None:
    """Step 4: tracking before and after."""
    page.heading("4  The same earthquake, tracked with each model inside")
    page.paragraph(
        "Observer and controller carry a copy of the table's model. First run: the declared model; second run: the "
        "model that was fitted and extended from the recordings. Errors are those of the true motion "
        "against the reference."
    )
    page.figure(figures_demo.tracking_figure(tracks.before, tracks.after), "Reference, position and position error")
    rows = [
        [name, percent(tracks.error_before[name]), percent(tracks.error_after[name])] for name in tracks.error_before
    ]
    page.table(["tracking error", "declared model", "extended model"], rows)


def demo_page(
    runs: MeasuredRuns,
    hidden: str,
    result: LoopClosure,
    learn: list[Record],
    hold: list[Record],
    tracks: Tracking,
    summary: Mapping[str, Any],
) -> str:
    """The whole page as HTML."""
    named = summary["hidden"]["named"] or "nothing"
    page = Page(
        "A shaking table, closed with measured data",
        "The declared model against the real table's harmonics; then a simulated table with an effect that the model "
        "does not have: recorded over DDS, fitted, traced, extended, and tracked again.",
    )
    page.cards(
        [
            (
                f"{runs.declared.rms:.3f} → {runs.best.rms:.3f} m/s²",
                f"harmonics of the real table, with {runs.best.name}",
            ),
            (named, f"named from the recording; hidden was {hidden}"),
            (
                f"{percent(summary['hidden']['hold_before'])} → {percent(summary['hidden']['hold_after'])}",
                "acceleration error of the free run, recording held out",
            ),
            (
                f"{percent(tracks.error_before['position'])} → {percent(tracks.error_after['position'])}",
                "position error of the earthquake",
            ),
        ]
    )
    measured_section(page, runs)
    page.heading("2  The loop over DDS")
    page.paragraph(
        f"Plant, reference generator, observer, controller and recorder ran in lock-step as separate processes: "
        f"{len(tracks.before.time)} samples of the earthquake (held out) and {sum(len(r.commands) for r in learn)} "
        "samples of an excitation to learn from."
    )
    page.heading("3  Closing the loop")
    model_sections(page, result, hold)
    tracking_section(page, tracks)
    return page.render()
