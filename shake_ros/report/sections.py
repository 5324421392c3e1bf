"""Sections that several pages have: measured against simulated, errors, what remains, parameters, tracking."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.trials import TrackingBenefit
from shake_ros.explain.account import verdict
from shake_ros.explain.diagnosis import Diagnosis
from shake_ros.explain.experiments import stated
from shake_ros.explain.prediction import HORIZONS, RATES, Innovations
from shake_ros.fit.declared_model import DeclaredModel
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.records import Record, longest
from shake_ros.fit.uncertainty import Estimate
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.report import charts_fit
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Page, Source
from shake_ros.report.result_table import percent
from shake_ros.report.text import (
    error_table,
    estimate_text,
    nuisance_table,
    resting_text,
    sentence,
    slow_change_table,
    unit_of,
)
from shake_ros.search.declared_fit import FittedModel


def innovations_table(page: Page, found: Innovations) -> None:
    """Errors of runs that are corrected towards the measurement, by rate, and of predictions, by horizon."""
    page.subheading("Error of prediction against horizon", detail=True)
    page.paragraph(sentence(found.text))
    page.paragraph(
        "Rms over validation data in multiples of the sensor noise. A corrected run is pulled towards the measurement "
        "at a rate, like an observer; beside it is the error that sensor noise alone would cause. A prediction is "
        "free from the instant at which it is made; the measured velocity has looked some 10 ms ahead of that.",
        note=True,
    )
    rows = []
    for channel, errors in found.errors.items():
        cells = zip(errors, found.by_noise[channel], strict=True)
        rows.append([channel, *(f"{e:.2f} ({alone:.2f})" for e, alone in cells)])
    page.table(["corrected at (noise alone)", "free run", *(f"{rate:g} 1/s" for rate in RATES[1:])], rows)
    rows = [[channel, *(f"{e:.2f}" for e in errors)] for channel, errors in found.horizons.items()]
    page.table(["predicted ahead by", *(f"{1e3 * h:g} ms" for h in HORIZONS)], rows)


SLOW_CHANGES = (
    "Estimated from the recording's own position, since friction and amplifiers warm up between recordings and within "
    "them; the level is that of all friction relative to the first estimation recording. The errors of the free run "
    "on this page include them. The last column is the error of a run from the force alone."
)


def slow_changes_section(page: Page, tables: Sequence[TableParameters], records: Sequence[Record]) -> None:
    """Nuisance parameters of each recording, and its position error under every table; nothing where none has."""
    if any(record.own for record in records):
        page.subheading("Nuisance parameters of each recording")
        page.paragraph(SLOW_CHANGES)
        page.result(slow_change_table(tables, records))


ERROR = "Error of the free run: rms(measured − simulated) / rms(measured − mean), simulated from the command alone."
TEST = "Validation data have selected the model; no decision used the test data."
DRAWN = 8  # recordings with charts of their own
SHOWN = 2.0  # of the tracked motion at first, about the largest acceleration of the reference [s]


def sources_of(estimation: Sequence[Record], validation: Sequence[Record], test: Sequence[Record] = ()) -> list[Source]:
    """Where the page of a fit comes from: each recording once, with the length of its parts together."""
    found = []
    for use, records in (("estimation", estimation), ("validation", validation), ("test", test)):
        for name in dict.fromkeys(r.name for r in records):
            parts = [r for r in records if r.name == name]
            samples = sum(len(r.commands) for r in parts)
            dt = parts[0].sample_time
            found.append(Source(name, use, samples * dt, samples, 1.0 / dt))
    return found


def histories_section(
    page: Page,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    tables: tuple[TableParameters, TableParameters],
    model: DeclaredModel,
    labels: Sequence[str] = charts_fit.BOTH,
    test: Sequence[Record] = (),
) -> list[list[str]]:
    """Measured against simulated, recording by recording, test and validation data first.

    Returns the errors by band.
    """
    page.heading("Measured against simulated")
    page.hint("Drag over a chart to zoom, double click for all of it; the panels of a recording move together.")
    bands = []
    sets = (("test", test), ("validation", validation), ("estimation", estimation))
    drawn = [(r, role) for role, records in sets for r in longest(records)]
    for record, role in drawn[:DRAWN]:
        runs = charts_fit.free_runs(record, *tables, model)
        page.chart(charts_fit.history_chart(record, runs, labels, role=f" ({role})"))
        if role != "estimation" or not validation:
            page.chart(charts_fit.spectrum_chart(record, runs, labels))
        channel, rows = charts_fit.band_errors(record, runs)
        bands += [[f"{record.name} ({role})", channel, band, *map(percent, errors)] for band, errors in rows]
    if len(drawn) > DRAWN:
        page.paragraph(f"The first {DRAWN} of {len(drawn)} recordings.", note=True)
    return bands


def parameters_side_by_side(page: Page, models: Mapping[str, FittedModel]) -> None:
    """Parameters of models side by side; the last model's make the rows. At a bound: marked, and which."""
    *_, last = models.values()
    known = [{p.name: p for p in model.parameters} for model in models.values()]
    ends = [{f.name: (f.low, f.high) for f in model.fit.free.free} for model in models.values()]
    rows, warn = [], []
    for i, p in enumerate(last.parameters):
        cells = [_parameter(found.get(p.name), limits.get(p.name)) for found, limits in zip(known, ends, strict=True)]
        if "bound" in cells[-1] or "not known" in cells[-1]:
            warn.append(i)
        meaning = str(last.table.fields[p.name].metadata["meaning"]) if p.name in last.table.fields else ""
        rows.append([p.name.removeprefix("effects."), *cells, unit_of(p.unit)[1], meaning])
    page.table(["parameter", *models, "unit", "meaning"], rows, warn=warn)


def _parameter(p: Estimate | None, limits: tuple[float, float] | None) -> str:
    if p is None:
        return "–"
    if p.std_error is not None or limits is None:
        return estimate_text(p)
    low, high = limits
    if min(abs(p.value - low), abs(high - p.value)) > 1e-3 * (high - low):
        return f"{estimate_text(p)},\ndoes not act"
    return resting_text(p, low, high)


def identified_section(page: Page, identified: Sequence[Estimate], data: Prepared | None) -> None:
    """What recordings determine of a table without a data sheet, and what was done to them; of others the latter."""
    if data is None:
        return
    for line in data.stops:
        page.paragraph(f"{line}.")
    if not identified:
        return
    page.heading("What the recordings determine of this table")
    page.paragraph("These quantities do not depend on the assumed area and supply pressure.")
    rows = [[p.name, estimate_text(p), unit_of(p.unit)[1]] for p in identified]
    page.table(("quantity", "value", "unit"), rows)
    page.paragraph("Removed from the recordings:")
    page.result(nuisance_table(data))
    for line in data.changes():
        page.paragraph(sentence(line))


def hydraulic_table(page: Page, models: Mapping[str, FittedModel]) -> None:
    """β_1 … β_5 of the reduced model as hydraulic frequency, damping and velocity gain, valve closed and half open."""
    rows = []
    for opening, text in ((0.0, "valve closed"), (0.5, "valve half open")):
        for name, model in models.items():
            beta = {p.name: p.value for p in model.parameters}
            a = -(beta["dynamics.beta1"] + beta["dynamics.beta5"] * opening)
            b = -(beta["dynamics.beta2"] + beta["dynamics.beta4"] * opening)
            omega = math.sqrt(a)
            gain = beta["dynamics.beta3"] / a
            rows.append(
                [text, name, f"{omega / (2.0 * math.pi):.2f} Hz", f"{b / (2.0 * omega):.3f}", f"{gain:.3f} m/s"]
            )
    page.table(("at", "model", "hydraulic frequency", "damping ratio", "velocity per full command"), rows)


def errors_section(
    page: Page,
    models: Mapping[str, FittedModel],
    bands: Sequence[Sequence[str]],
    labels: Sequence[str],
    noise: str = "",
) -> None:
    """Errors of the free run of models side by side, by recording and channel, then by band of frequency."""
    page.heading("Errors")
    page.paragraph(f"{ERROR}{noise}")
    page.result(error_table(models))
    if any(model.test for model in models.values()):
        page.paragraph(f"{TEST} They show how well the model predicts a new recording.", note=True)
    page.subheading("The same by frequency band", detail=True)
    page.paragraph(
        "The residual within the band over the whole measured signal: the squares of a recording's bands add up to the "
        "square of its error.",
        note=True,
    )
    page.table(["recording", "channel", "band", *labels], bands)


def remains_section(page: Page, diagnosis: Diagnosis, text: str = "") -> None:
    """How large the residual is beside the noise, what predicts it, and its correlations."""
    page.heading("What remains")
    if text:
        page.paragraph(sentence(text))
    page.paragraph(sentence(verdict(diagnosis.accounts)))
    page.paragraph(
        "Shares of the residual's mean square: what is white noise of the sensor; what a linear filter of the command "
        "explains; what a filter explains that may look ahead and uses the command's magnitude and sign as well, on a "
        "recording to which it was not fitted; what repeats and what differs between equal commands. What differs "
        "beyond the sensor noise cannot be predicted from the command: process noise, or an unknown initial state. "
        "At best is what a model of the command would be left with, in multiples of the noise. "
        "The test in the last column, at 99 % over ±25 lags, detects traces far below the noise: the shares matter.",
        note=True,
    )
    rows = []
    for p in diagnosis.accounts:
        shares = [p.noise_share, p.coherent, p.filtered, p.repeated, p.different]
        cells = ["–" if share is None else f"{100.0 * share:.0f} %" for share in shares]
        rows.append([p.label, p.channel, f"{p.ratio:.2f}", *cells, f"{p.least_ratio:.2f}", p.predicted_by])
    heads = ("× noise", "sensor noise", "linear in the command", "a filter explains", "repeats", "differs", "at best")
    page.table(("recording", "residual of", *heads, "predicted by"), rows)
    if any(p.shape for p in diagnosis.accounts):
        page.chart(charts_fit.correlation_chart(diagnosis.accounts, True))
        page.chart(charts_fit.correlation_chart(diagnosis.accounts, False))
    if diagnosis.backlash:
        page.paragraph(sentence(diagnosis.backlash))
    if diagnosis.innovations:
        innovations_table(page, diagnosis.innovations)


def known_section(page: Page, diagnosis: Diagnosis) -> None:
    """What the recordings identify, as sentence and matrix; then what to record next."""
    known = diagnosis.identifiability
    page.subheading("What these recordings identify")
    page.paragraph(sentence(known.text))
    page.paragraph("Correlation of the estimates; blank at a bound:", note=True)
    page.matrix([name.removeprefix("effects.") for name in known.names], known.correlation)
    page.heading("What to record next")
    page.paragraph(sentence(diagnosis.advice))
    if diagnosis.benefits:
        page.subheading("Uncertainty with one recording more", detail=True)
        page.paragraph(
            "Uncertainty of each parameter now, and with one recording more, in % of its value, or of its usual size "
            "where that is larger:",
            note=True,
        )
        columns = [known.deviations, *(b.deviations for b in diagnosis.benefits)]
        rows = [
            [name.removeprefix("effects."), *(stated(float(d[k])) for d in columns)]
            for k, name in enumerate(known.names)
        ]
        page.table(["parameter", "now", *(b.candidate.name for b in diagnosis.benefits)], rows)


class Track(NamedTuple):
    """A tracked motion. time : (n,) [s]. reference, motion : (n, 3) position, velocity, acceleration in SI units."""

    time: NDArray[np.float64]
    reference: NDArray[np.float64]
    motion: NDArray[np.float64]
    errors: Mapping[str, float]


def tracking_chart(tracks: Mapping[str, Track]) -> Chart:
    """Acceleration of reference and table, and position error; initially around the largest acceleration."""
    first, *_ = tracks.values()
    n = min(len(track.time) for track in tracks.values())
    time, wanted = first.time[:n], first.reference[:n]
    peak = float(time[np.nanargmax(np.abs(wanted[:, 2]))])
    felt = [ChartSeries("reference", wanted[:, 2], "measured", width=1.8)]
    missed = []
    for (label, track), colour in zip(tracks.items(), ("before", "after", "c3"), strict=False):
        felt.append(ChartSeries(label, track.motion[:n, 2], colour))
        missed.append(ChartSeries(label, 1e3 * (track.motion[:n, 0] - track.reference[:n, 0]), colour))
    panels = (
        Panel("acceleration [m/s²]", time, tuple(felt)),
        Panel("position error [mm]", time, tuple(missed), height=140),
    )
    view = (max(peak - 0.5 * SHOWN, float(time[0])), min(peak + 0.5 * SHOWN, float(time[-1])))
    caption = "Acceleration of reference and table, and position error; initially around the largest acceleration"
    return Chart("tracking", "time [s]", panels, caption, view=view)


def tracking_section(page: Page, tracks: Mapping[str, Track]) -> None:
    """Tracking errors of both models as a table and a chart."""
    names = ("position", "velocity", "acceleration")
    page.table(("tracking error", *names), [[m, *(percent(t.errors.get(n)) for n in names)] for m, t in tracks.items()])
    page.chart(tracking_chart(tracks))


def benefit_section(page: Page, benefit: TrackingBenefit) -> None:
    """How much the extended model improves tracking."""
    page.heading("How much the extended model improves tracking")
    page.paragraph(
        f"The identified table tracks the reference '{benefit.reference}' in simulation, with sensor noise and delay: "
        "once with the declared model in observer and controller, once with the extended model. "
        "rms(motion − reference) / rms(reference − mean)."
    )
    errors = benefit.errors()
    tracks = {}
    labels = {"before": "declared model", "after": "extended model", "tuned": "extended model, gains made for it"}
    for when, run in benefit.runs.items():
        time = np.arange(len(run.reference), dtype=np.float64) * run.sample_time
        tracks[labels[when]] = Track(time, run.reference, run.truth, errors[when])
    for warning in benefit.warnings():
        page.paragraph(sentence(warning))
    tracking_section(page, tracks)
    if benefit.margins:
        page.paragraph(
            f"The closed loop with the gains made for the table, where it is least robust: {benefit.margins.text}."
        )
