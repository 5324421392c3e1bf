"""Sections that several pages have: parameters, errors, tests of the residuals, identifiability, tracking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shake_ros.core.discovery.declared_fit import FittedModel
from shake_ros.core.identification.diagnosis import Diagnosis, Judgement
from shake_ros.core.identification.nuisances import Nuisance
from shake_ros.core.identification.uncertainty import Estimate
from shake_ros.core.loop.benefit import TrackingBenefit
from shake_ros.report import figures_residual
from shake_ros.report.page import Page
from shake_ros.report.style import AFTER, BEFORE, MEASURED, new_figure, tidy
from shake_ros.report.text import percent, sentence

FREE_RUN = "Simulated from the recorded command alone; rms(measured − simulated) / rms(measured − mean)."
SHOWN = 2.0  # of the tracked motion, about the largest acceleration of the reference [s]


def parameter_table(page: Page, models: Mapping[str, Sequence[Estimate]]) -> None:
    """Parameters of models side by side with their standard errors; the last model's parameters make the rows."""

    def cell(p: Estimate | None) -> str:
        if p is None:
            return "–"
        return f"{p.value:.4g} " + ("(at bound)" if p.std_error is None else f"± {p.std_error:.2g}")

    *_, last = models.values()
    found = [{p.name: p for p in parameters} for parameters in models.values()]
    page.table(
        ["parameter", *models, "unit"], [[p.name, *(cell(known.get(p.name)) for known in found), p.unit] for p in last]
    )


def identified_section(page: Page, told: Sequence[Estimate], offsets: Sequence[Nuisance]) -> None:
    """What recordings tell of a table without a data sheet, and the offsets taken out of them; nothing for others."""
    if not told:
        return
    page.heading("What the recordings tell of this table")
    page.paragraph("Whatever its area and supply pressure: these quantities do not depend on what was assumed of them.")
    parameter_table(page, {"value": told})
    rows = [
        [n.recording, f"{n.null_shift:.5f}", "–" if n.acceleration_bias is None else f"{n.acceleration_bias:.4f}"]
        for n in offsets
    ]
    page.table(["taken out of the recording", "null shift of the valve [-]", "accelerometer bias [m/s²]"], rows)


def error_table(page: Page, models: Mapping[str, FittedModel]) -> None:
    """Errors of the free run of models side by side, a row for each recording."""
    first, *_ = models.values()
    rows = [
        [
            f"{name} ({role})",
            *(percent(getattr(m, role)[name].get(c)) for c in ("velocity", "acceleration") for m in models.values()),
        ]
        for role in ("estimation", "validation")
        for name in getattr(first, role)
    ]
    page.table(["recording", *(f"{c}{m and ', '}{m}" for c in ("velocity", "acceleration") for m in models)], rows)


def _verdict(passed: bool, probability: float) -> str:
    return f"{'yes' if passed else 'no'} (p = {probability:.2g})"


def _judgement_row(judgement: Judgement) -> list[str]:
    test, split = judgement.test, judgement.split
    total = max(split.linear + split.nonlinear + split.noise, 1e-300)
    unit = "m/s²" if judgement.channel == "acceleration" else "m/s"
    return [
        f"{judgement.name} ({'validation' if judgement.held_out else 'estimation'})",
        judgement.channel,
        _verdict(test.white, test.auto_p) if test else "too short",
        _verdict(test.independent, test.cross_p) if test else "too short",
        *(f"{100.0 * part / total:.0f} %" for part in (split.linear, split.nonlinear, split.noise)),
        f"{judgement.noise:.2g} {unit} ({judgement.noise_from})",
    ]


def diagnosis_section(page: Page, diagnosis: Diagnosis) -> None:
    """Whiteness, independence and split of the residuals; what the recordings identify and which one would help."""
    page.heading("Is the residual noise?")
    page.paragraph(
        "Tests over ±25 lags at 99 %. A residual is white if its past does not predict it, and independent if the "
        "drive does not. Its mean square is split into what a linear filter of the drive explains, the channel's noise "
        "(from repeated periods where the command repeats, else from the band above the dynamics), and the rest, "
        "which is nonlinear."
    )
    page.table(
        (
            "recording",
            "residual of",
            "white",
            "independent of the drive",
            "unmodelled linear",
            "nonlinear",
            "noise",
            "noise (from)",
        ),
        [_judgement_row(j) for j in diagnosis.judgements],
    )
    if any(j.test for j in diagnosis.judgements):
        page.figure(figures_residual.correlogram(diagnosis.judgements), "Correlation of the residual; band: 99 %")
    known = diagnosis.identifiability
    page.heading("What do these recordings identify?")
    page.paragraph(f"{sentence(known.text)} {sentence(diagnosis.advice)}")
    page.figure(figures_residual.correlation_figure(known), "Correlation of the estimates")
    if diagnosis.benefits:
        columns = [known.deviations, *(b.deviations for b in diagnosis.benefits)]
        rows = [[name, *(f"± {100.0 * d[k]:.2g} %" for d in columns)] for k, name in enumerate(known.names)]
        page.table(["parameter", "now", *(f"with {b.candidate.name}" for b in diagnosis.benefits)], rows)


class Track(NamedTuple):
    """A tracked motion. time : (n,) [s]. reference, motion : (n, 3) position, velocity, acceleration in SI units."""

    time: NDArray[np.float64]
    reference: NDArray[np.float64]
    motion: NDArray[np.float64]
    errors: Mapping[str, float]


def tracking_axes(axes: Axes, tracks: Mapping[str, Track]) -> None:
    """Position error of the true motion over time."""
    for (label, track), colour in zip(tracks.items(), (BEFORE, AFTER), strict=True):
        error = 1e3 * (track.motion[:, 0] - track.reference[:, 0])
        axes.plot(track.time, error, color=colour, linewidth=1.0, label=label)
    tidy(axes, "time [s]", "position error [mm]")


def tracking_figure(tracks: Mapping[str, Track]) -> Figure:
    """Acceleration wanted and reached about its peak, and the error of the position over the whole run."""
    first, *_ = tracks.values()
    peak = first.time[np.nanargmax(np.abs(first.reference[:, 2]))]
    figure = new_figure(9.5, 5.2)
    upper, lower = figure.subplots(2, 1)
    shown = np.abs(first.time - peak) <= 0.5 * SHOWN
    upper.plot(first.time[shown], first.reference[shown, 2], color=MEASURED, linewidth=1.6, label="reference")
    for (label, track), colour in zip(tracks.items(), (BEFORE, AFTER), strict=True):
        shown = np.abs(track.time - peak) <= 0.5 * SHOWN
        upper.plot(track.time[shown], track.motion[shown, 2], color=colour, linewidth=1.0, label=label)
    tidy(upper, "time [s]", "acceleration [m/s²]")
    tracking_axes(lower, tracks)
    upper.legend(frameon=False, ncols=3)
    return figure


def tracking_section(page: Page, tracks: Mapping[str, Track]) -> None:
    """Tracking errors of both models as a table and a figure."""
    names = ("position", "velocity", "acceleration")
    page.table(("tracking error", *names), [[m, *(percent(t.errors.get(n)) for n in names)] for m, t in tracks.items()])
    page.figure(tracking_figure(tracks), "Acceleration about its peak; position error of the whole run")


def benefit_section(page: Page, benefit: TrackingBenefit) -> None:
    """What the extended model gains in the loop."""
    page.heading("What the extended model gains in the loop")
    page.paragraph(
        f"The identified table follows the reference '{benefit.reference}' in simulation, with sensor noise and delay: "
        "once with the declared model in observer and controller, once with the extended model. "
        "rms(motion − reference) / rms(reference − mean)."
    )
    errors = benefit.errors()
    tracks = {}
    for name, run, when in (("declared model", benefit.before, "before"), ("extended model", benefit.after, "after")):
        time = np.arange(len(run.reference), dtype=np.float64) * run.sample_time
        tracks[name] = Track(time, run.reference, run.truth, errors[when])
    tracking_section(page, tracks)
