"""The comparison of models with the measured runs: charts, lines for a terminal, the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.fit.uncertainty import Estimate, at_bound
from shake_ros.measured.harmonics import HarmonicProblem, HarmonicRun
from shake_ros.measured.models import HarmonicComparison, MeasuredModel
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel
from shake_ros.report.page import Page
from shake_ros.report.result_table import ResultTable, fixed
from shake_ros.report.text import estimate_text, resting_text, sentence, unit_of

COLOURS = ("c5", "c3", "before")  # of the printed models, the last one counts


def title(run: HarmonicRun) -> str:
    """A run's command."""
    return f"u = {run.amplitude:g} sin(2π {run.frequency:g} t)"


def harmonics_chart(problem: HarmonicProblem, models: Sequence[tuple[str, Array, str]]) -> Chart:
    """Amplitudes of every run, measured and of each model given as name, amplitudes of all runs and colour."""
    panels = []
    for run, span in zip(problem.runs, problem.spans, strict=True):
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


RUNS_NOTE = "amplitude of the acceleration [m/s²] by order; THD of these orders and of all orders simulated"


def run_table(comparison: HarmonicComparison, index: int) -> ResultTable:
    """One run: each order's amplitude, measured and of each model shown, with its error and its THD."""
    run, span = comparison.problem.runs[index], comparison.problem.spans[index]
    measured = 100.0 * float(comparison.problem.distortion(comparison.problem.measured)[index])
    rows: list[tuple[str | float | None, ...]] = [("measured", *map(float, run.measured), None, measured, None)]
    for model in (*comparison.printed, *comparison.fitted):
        found = model.account
        thd = (100.0 * float(found.distortion[index]), 100.0 * float(found.whole_distortion[index]))
        rows.append((model.name, *map(float, found.amplitudes[span]), float(found.run_rms[index]), *thd))
    orders = [str(k) for k in run.orders]
    formats = {**dict.fromkeys(orders, fixed(2)), "rms": fixed(3), "THD [%]": fixed(1), "of all orders": fixed(1)}
    return ResultTable((title(run), *orders, "rms", "THD [%]", "of all orders"), rows, formats)


def model_table(models: Sequence[MeasuredModel]) -> ResultTable:
    """Models side by side: parameters fitted, errors, and their THD minus the measured one [points], run by run."""
    rows = [
        (
            m.name,
            len(m.fitted.fit.x) if m.fitted else None,
            m.account.rms,
            m.fitted.criterion if m.fitted else None,
            m.left_out.rms if m.left_out else None,
            *(100.0 * float(points) for points in m.account.distortion_error),
        )
        for m in models
    ]
    runs = [f"THD {i + 1}" for i in range(len(models[0].account.distortion_error))]
    formats = {"rms": fixed(3), "criterion": fixed(1), "left out": fixed(3)} | dict.fromkeys(runs, fixed(1, "+"))
    return ResultTable(("model", "fitted", "rms", "criterion", "left out", *runs), rows, formats)


def left_out_table(models: Sequence[MeasuredModel]) -> ResultTable:
    """Error of each run while it is left out [m/s²]."""
    rows = [(m.name, *map(float, m.left_out.run_rms)) for m in models if m.left_out]
    runs = [f"run {i + 1}" for i in range(len(rows[0]) - 1)] if rows else []
    return ResultTable(("model", *runs), rows, dict.fromkeys(runs, fixed(3)))


def second_lines(comparison: HarmonicComparison) -> list[str]:
    """Whether a second effect pays, by the criterion and by the runs left out."""
    base = comparison.chosen
    if not comparison.seconds or base.fitted is None or base.left_out is None:
        return []
    by_criterion, by_prediction = [], []
    for model in comparison.seconds:
        assert model.fitted is not None and model.left_out is not None
        if model.fitted.criterion < base.fitted.criterion:
            by_criterion.append(model.fitted.name)
        if model.left_out.rms < base.left_out.rms:
            by_prediction.append(model.fitted.name)
    both = [name for name in by_criterion if name in by_prediction]
    return [
        f"better with a second effect, by the criterion:     {', '.join(by_criterion) or 'none'}",
        f"better with a second effect, by the runs left out: {', '.join(by_prediction) or 'none'}",
        f"by both: {', '.join(both) or 'none'}",
    ]


def measured_page(comparison: HarmonicComparison) -> Page:
    """What explains the real table's harmonics, how well, and why not another model."""
    problem, chosen = comparison.problem, comparison.chosen
    count = len(problem.runs)
    page = Page(
        "The real table's measured runs",
        f"{len(problem.measured)} amplitudes of {count} run{'s' * (count > 1)} under open-loop sines against printed "
        "and fitted models.",
    )
    page.heading("What was found, and how certain it is")
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
    page.heading("Errors, run by run")
    page.paragraph(sentence(RUNS_NOTE))
    for index in range(len(problem.runs)):
        page.result(run_table(comparison, index))
    page.heading("Why this model and not another")
    page.paragraph(
        "Rms errors in m/s². The Bayesian information criterion penalises parameters; lower is better. Left out: every "
        "run predicted by the model fitted to the others. THD: minus the measured one, in points, run by run."
    )
    page.result(model_table(comparison.models), best=comparison.models.index(chosen))
    left_out = left_out_table(comparison.models)
    if left_out.rows:
        page.subheading("Rms error of each run, predicted by the model fitted to the others [m/s²]")
        page.result(left_out)
    if comparison.exchanged:
        page.subheading(f"Where {comparison.printed[-1].name} differs")
        page.paragraph("The printed model with one group of parameters from the fit at a time.", note=True)
        page.result(model_table(comparison.exchanged))
    _parameters(page, chosen)
    return page


def _parameters(page: Page, model: MeasuredModel) -> None:
    if model.fitted is None:
        return
    page.heading("Parameters")
    fit = model.fitted.fit
    rows, warn = [], []
    for i, (f, value, resting) in enumerate(
        zip(fit.free.free, (fit.x * fit.free.scale).tolist(), at_bound(fit), strict=True)
    ):
        estimate = Estimate(f.name, value, None, f.unit)
        text = resting_text(estimate, f.low, f.high) if resting else estimate_text(estimate)
        if resting:
            warn.append(i)
        meaning = str(model.table.fields[f.name].metadata["meaning"])
        rows.append([f.name.removeprefix("effects."), text, unit_of(f.unit)[1], meaning])
    page.table(("parameter", model.name, "unit", "meaning"), rows, warn=warn)
