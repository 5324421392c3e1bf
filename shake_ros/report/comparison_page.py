"""A comparison of controllers: charts of figures 6.61 and 6.62, tables as text, the page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.loop.metrics import Outcome, Summary, by_load, summarise
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel
from shake_ros.report.page import Bar, Made, Page
from shake_ros.report.result_table import percent

CURVES = 6  # of a chart, a colour each: no more than static_figure.COLOURS
QUANTITIES = (("position", "mm"), ("velocity", "mm/s"))
HIGHEST_SHOWN = 30.0  # [Hz]
LEAST_SHOWN = 1e-5  # of the reference's largest line: a synthetic reference has next to nothing beyond its band


def error_chart(runs: Mapping[str, ClosedLoop], case: str = "", part: int = 1) -> Chart:
    """Figure 6.61: position and velocity error of each controller over time."""
    panels = []
    for column, (name, unit) in enumerate(QUANTITIES):
        time = np.arange(max(len(run.command) for run in runs.values())) * next(iter(runs.values())).sample_time
        series = []
        for k, (label, run) in enumerate(runs.items()):
            error = np.full(len(time), np.nan)
            error[: len(run.truth)] = 1e3 * (run.truth[:, column] - run.reference[:, column])
            series.append(ChartSeries(label, error, f"c{k % 6}"))
        panels.append(Panel(f"{name} error [{unit}]", time, tuple(series)))
    return Chart(f"errors_{part}", "time [s]", tuple(panels), f"Position and velocity error{case and f', {case}'}")


def response_chart(number: str, run: ClosedLoop, caption: str) -> Chart:
    """Position and velocity of one run over its reference, and the command, as figures 6.43 to 6.60."""
    time = np.arange(len(run.command)) * run.sample_time
    panels = [
        Panel(
            f"{name} [{unit}]",
            time,
            (
                ChartSeries("reference", 1e3 * run.reference[:, column], "measured", width=1.8),
                ChartSeries("table", 1e3 * run.truth[:, column], "after"),
            ),
        )
        for column, (name, unit) in enumerate(QUANTITIES)
    ]
    panels.append(Panel("command [-]", time, (ChartSeries("command", run.command, "before"),)))
    return Chart(f"figure_{number.split(',', maxsplit=1)[0]}", "time [s]", tuple(panels), caption)


def amplitudes(signal: Array, sample_time: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes of the signal's lines up to 30 Hz [unit of the signal]."""
    spectrum = 2.0 * np.abs(np.fft.rfft(signal - signal.mean())) / len(signal)
    frequency = np.asarray(np.fft.rfftfreq(len(signal), sample_time), dtype=np.float64)
    shown = (frequency > 0.0) & (frequency <= HIGHEST_SHOWN)
    return frequency[shown], spectrum[shown]


def spectrum_chart(runs: Mapping[str, ClosedLoop], case: str = "", part: int = 1) -> Chart:
    """Figure 6.62: spectra of position and velocity of the reference and under each controller."""
    panels = []
    first = next(iter(runs.values()))
    sound = {label: run for label, run in runs.items() if np.isfinite(run.truth).all()}
    for column, (name, unit) in enumerate(QUANTITIES):
        frequency, wanted = amplitudes(1e3 * first.reference[:, column], first.sample_time)
        least = LEAST_SHOWN * float(np.max(wanted, initial=0.0))

        def shown(lines: Array, least: float = least) -> Array:
            return np.where(lines >= least, lines, np.nan)

        series = [ChartSeries("reference", shown(wanted), "measured", width=1.8)]
        for label, run in sound.items():
            found = amplitudes(1e3 * run.truth[:, column], run.sample_time)[1]
            if len(found) == len(frequency):
                series.append(ChartSeries(label, shown(found), f"c{list(runs).index(label) % 6}"))
        panels.append(Panel(f"{name} [{unit}]", frequency, tuple(series), log=True))
    caption = f"Amplitude spectra of position and velocity{case and f', {case}'}"
    return Chart(f"spectra_{part}", "frequency [Hz]", tuple(panels), caption)


HEAD = (
    "controller", "J1 [ms]", "position", "worst", "velocity", "worst", "acceleration", "worst", "spectrum", "THD",
    "travel [1/s]", "at limit", "perturbed", "unstable", "end stop",
)  # fmt: skip


def number(value: float, digits: int = 2) -> str:
    """A number, a dash where there is none."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"


def summary_rows(summaries: Sequence[Summary]) -> list[list[str]]:
    """One row per controller under HEAD: mean and worst over references and loads, worst over the perturbed tables."""
    rows = []
    for s in summaries:
        m, w = s.mean, s.worst
        rows.append(
            [s.entry, number(1e3 * m.delay)]
            + [
                percent(value)
                for name in ("position_error", "velocity_error", "acceleration_error")
                for value in (getattr(m, name), getattr(w, name))
            ]
            + [percent(m.spectrum_error), percent(m.thd), number(m.command_travel), percent(m.time_at_limit)]
            + [percent(s.perturbed_worst.position_error), str(s.unstable), str(s.end_stops)]
        )
    return rows


def load_rows(outcomes: Sequence[Outcome]) -> tuple[list[str], list[list[str]]]:
    """Head and rows: mean position error and command travel of each controller by load."""
    loads = sorted({o.load for o in outcomes if o.table < 0})
    head = ["controller"] + [f"position, {load:g} kg" for load in loads] + [f"travel, {load:g} kg" for load in loads]
    rows = []
    for entry in dict.fromkeys(o.entry for o in outcomes):
        errors, travels = (by_load(outcomes, entry, name) for name in ("position_error", "command_travel"))
        rows.append([entry, *(percent(errors[x]) for x in loads), *(number(travels[x]) for x in loads)])
    return head, rows


def trouble(outcomes: Sequence[Outcome]) -> list[str]:
    """A line for each run that was unstable or touched an end stop."""
    lines = []
    for o in outcomes:
        what = [text for text, flag in (("unstable", o.metrics.unstable), ("end stop", o.metrics.end_stop)) if flag]
        if what:
            table = f"perturbed table {o.table}" if o.table >= 0 else "declared table"
            lines.append(f"{o.entry}: {o.reference}, {o.load:g} kg, {table}: {' and '.join(what)}")
    return lines


CASE_HEAD = (
    "controller", "load [kg]", "J1 [ms]", "position", "peak", "velocity", "peak", "acceleration", "spectrum",
    "its largest", "THD", "travel [1/s]", "at limit",
)  # fmt: skip

LONGEST = 5.0  # bar, in multiples of the shortest


def case_rows(outcomes: Sequence[Outcome]) -> list[list[str]]:
    """One row per run under CASE_HEAD."""
    rows = []
    for o in outcomes:
        m = o.metrics
        shares = (
            m.position_error, m.position_peak_error, m.velocity_error, m.velocity_peak_error, m.acceleration_error,
            m.spectrum_error, m.spectrum_largest_error, m.thd,
        )  # fmt: skip
        rows.append(
            [
                o.entry,
                f"{o.load:g}",
                number(1e3 * m.delay),
                *(percent(x) for x in shares),
                number(m.command_travel),
                percent(m.time_at_limit),
            ]
        )
    return rows


def best_of(summaries: Sequence[Summary]) -> int | None:
    """The controller of the least worst position error among those that never were unstable."""
    sound = [i for i, s in enumerate(summaries) if s.unstable == 0 and s.end_stops == 0]
    return min(sound, key=lambda i: summaries[i].worst.position_error) if sound else None


def worst_rows(summaries: Sequence[Summary]) -> list[list[str | Bar]]:
    """The worst errors of every controller with bars from zero, drawn up to five times the least of a column."""
    names = ("position_error", "velocity_error", "acceleration_error")
    rows: list[list[str | Bar]] = [[s.entry] for s in summaries]
    for name in names:
        values = [float(getattr(s.worst, name)) for s in summaries]
        widest = LONGEST * min((v for v in values if math.isfinite(v)), default=1.0)
        for row, value in zip(rows, values, strict=True):
            beyond = " ▸" * (value > widest)
            row.append(Bar(value / widest if math.isfinite(value) else 0.0, f"{percent(value)}{beyond}"))
    return rows


def comparison_page(
    outcomes: Sequence[Outcome], runs: Mapping[str, ClosedLoop], figure_case: str, plant: str, command: str = ""
) -> Page:
    """The whole page.

    Parameters
    ----------
    runs : of the case that is drawn, by controller.
    figure_case : that case in words.
    plant : the plant in words.
    """
    summaries = summarise(outcomes)
    best = best_of(summaries)
    page = Page("Controllers side by side", f"One set of gains for every reference and load. {plant}", Made(command))
    page.heading("What was found")
    cards = [(str(len(outcomes)), "closed loops"), (str(len(trouble(outcomes))), "of them unstable or at an end stop")]
    if best is not None:
        cards.insert(
            0, (percent(summaries[best].worst.position_error), f"worst position error: {summaries[best].entry}")
        )
    page.cards(cards)
    page.heading("All controllers")
    page.paragraph(
        "Errors are the normalised root mean square of the true motion against the reference (J2), mean and worst over "
        "references and loads; J1 is the delay; spectrum is the error of the response spectrum at 5 % damping from 0.5 "
        "to 15 Hz; THD is of the acceleration under sines; travel is of the valve command; perturbed is the worst "
        "position error on the perturbed tables."
    )
    page.table(HEAD, summary_rows(summaries), best=best)
    page.subheading("Worst errors over references and loads")
    page.paragraph(f"Bars start at zero; ▸ marks one that is longer than {LONGEST:g} times the shortest.", note=True)
    page.table(("controller", "position", "velocity", "acceleration"), worst_rows(summaries), best=best)
    page.heading("By load")
    head, rows = load_rows(outcomes)
    page.table(head, rows)
    page.heading("Errors and spectra")
    groups = list(runs.items())
    for start in range(0, len(groups), CURVES):
        part = dict(groups[start : start + CURVES])
        page.chart(error_chart(part, figure_case, start // CURVES + 1))
        page.chart(spectrum_chart(part, figure_case, start // CURVES + 1))
    page.heading("Unstable runs and end stops")
    lines = trouble(outcomes)
    page.paragraph("None." if not lines else f"{len(lines)} runs:")
    if lines:
        page.table(["run"], [[line] for line in lines])
    declared = [o for o in outcomes if o.table < 0]
    for reference in dict.fromkeys(o.reference for o in declared):
        page.heading(f"Reference {reference}")
        page.table(CASE_HEAD, case_rows([o for o in declared if o.reference == reference]))
    return page
