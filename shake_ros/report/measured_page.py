"""The page of `measured_runs`."""

from __future__ import annotations

from shake_ros.core.identification.uncertainty import Estimate, at_bound
from shake_ros.core.measured_harmonics.account import measured_distortion
from shake_ros.core.measured_harmonics.comparison import HarmonicComparison, MeasuredModel
from shake_ros.report.charts_harmonics import harmonics_chart, shown, title, traces_chart
from shake_ros.report.measured_text import second_lines
from shake_ros.report.page import Bar, Made, Page
from shake_ros.report.readable import bound_text, estimate_text, unit_of


def measured_page(comparison: HarmonicComparison, command: str = "") -> Page:
    """What explains the real table's harmonics, how well, and why not another model."""
    problem, chosen = comparison.problem, comparison.chosen
    count = len(problem.runs)
    page = Page(
        "The real table's measured runs",
        f"{len(problem.measured)} amplitudes of {count} run{'s' * (count > 1)} under open-loop sines against printed "
        "and fitted models.",
        Made(command),
    )
    page.heading("What was found, and how sure")
    cards = [(chosen.name, "explains the runs best by the information criterion")]
    if comparison.printed:
        last = comparison.printed[-1]
        cards.append((f"{last.account.rms:.3f} → {chosen.account.rms:.3f} m/s²", f"rms error, from {last.name}"))
    if chosen.left_out:
        cards.append((f"{chosen.left_out.rms:.3f} m/s²", "rms error where each run is predicted from the others"))
    page.cards(cards)
    for line in second_lines(comparison):
        page.paragraph(line)
    page.heading("Measured against simulated")
    page.chart(harmonics_chart(problem, [(m.name, m.account.amplitudes, colour) for m, colour in shown(comparison)]))
    page.chart(traces_chart(comparison))
    _errors(page, comparison)
    page.heading("Why this model and not another")
    page.paragraph(
        "The Bayesian information criterion makes a model earn its parameters; lower is better. Left out: every run "
        "predicted by the model fitted to the others. Bars start at zero."
    )
    _models(page, comparison.models, comparison.models.index(chosen))
    if comparison.exchanged:
        page.subheading(f"Where {comparison.printed[-1].name} differs")
        page.paragraph("The printed model with one group of parameters from the fit at a time.", note=True)
        _models(page, comparison.exchanged)
    _parameters(page, chosen)
    return page


def _errors(page: Page, comparison: HarmonicComparison) -> None:
    page.heading("Errors, run by run")
    page.paragraph(
        "Rms error of the amplitudes of each run [m/s²], and total harmonic distortion of the same orders: measured, "
        "and each model's."
    )
    models = [m for m, _ in shown(comparison)]
    measured = measured_distortion(comparison.problem)
    rows = []
    for i, run in enumerate(comparison.problem.runs):
        errors = [f"{m.account.run_rms[i]:.3f}" for m in models]
        thd = [f"{100.0 * measured[i]:.1f} %", *(f"{100.0 * m.account.distortion[i]:.1f} %" for m in models)]
        rows.append([title(run), *errors, *thd])
    head = ["run", *(f"error, {m.name}" for m in models), "THD, measured", *(f"THD, {m.name}" for m in models)]
    page.table(head, rows)


def _models(page: Page, models: tuple[MeasuredModel, ...], best: int | None = None) -> None:
    widest = max(m.account.rms for m in models)
    rows: list[list[str | Bar]] = [
        [
            m.name,
            str(len(m.fitted.fit.x)) if m.fitted else "–",
            Bar(m.account.rms / widest, f"{m.account.rms:.3f}"),
            f"{m.left_out.rms:.3f}" if m.left_out else "–",
            f"{m.fitted.criterion:.1f}".replace("-", "−") if m.fitted else "–",
        ]
        for m in models
    ]
    page.table(("model", "parameters fitted", "rms error [m/s²]", "left out [m/s²]", "criterion"), rows, best=best)


def _parameters(page: Page, model: MeasuredModel) -> None:
    if model.fitted is None:
        return
    page.heading("Parameters")
    fit = model.fitted.fit
    rows, warn = [], []
    for i, (f, value, resting) in enumerate(
        zip(fit.free.free, (fit.x * fit.free.scale).tolist(), at_bound(fit), strict=True)
    ):
        text = estimate_text(Estimate(f.name, value, None, f.unit))
        if resting:
            warn.append(i)
            text += f",\n{bound_text(value, f.low, f.high)}"
        meaning = str(model.table.fields[f.name].metadata["meaning"])
        rows.append([f.name.removeprefix("effects."), text, unit_of(f.unit)[1], meaning])
    page.table(("parameter", model.name, "unit", "meaning"), rows, warn=warn)
