"""`compare`: the controllers side by side on the same references, loads and perturbed tables; charts and page."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shake_ros.api.loops import Combination, Course, Setup, combinations, load_setup
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.control.closed_loop import ClosedLoop, Loop, run_batch
from shake_ros.control.metrics import MEANINGS, UNITS, Outcome, Summary, by_load, judge, summarise
from shake_ros.quantities import unknown_name
from shake_ros.report.chart import COLOURS, Array, Chart, ChartSeries, Panel, static_figure
from shake_ros.report.page import Bar, Page, Result
from shake_ros.report.result_table import fixed, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SCHEMA = "shake_ros.compare/1"
TOGETHER = len(COLOURS)  # controllers in a chart, a colour each
QUANTITIES = (("position", "mm"), ("velocity", "mm/s"))
HIGHEST_SHOWN = 30.0  # [Hz]
LEAST_SHOWN = 1e-5  # of the reference's largest line: a synthetic reference has next to nothing beyond its band


@dataclass(frozen=True)
class Case:
    """One run to be made, and its place in the comparison."""

    loop: Loop
    entry: str
    course: Course
    load: float
    table: int


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Controllers on the same references, loads and perturbed tables.

    Attributes
    ----------
    settings : of the comparison.
    plant : in a sentence.
    outcomes : every run with its figures.
    summaries : one for each controller.
    runs : of the case that is drawn, by controller.
    drawn : that case in words.
    """

    numbers = "compare.json"
    settings: Mapping[str, Any]
    plant: str
    outcomes: Sequence[Outcome]
    runs: Mapping[str, ClosedLoop]
    drawn: str

    @property
    def summaries(self) -> list[Summary]:
        """Mean and worst figures of each controller."""
        return summarise(self.outcomes)

    def plot(self) -> Figure:
        """Errors of each controller over the case that is drawn."""
        return static_figure(error_chart(self.runs, self.drawn))

    def content(self) -> dict[str, Any]:
        """All figures, for JSON (schema shake_ros.compare/1)."""
        summaries, runs = list[dict[str, Any]](), list[dict[str, Any]]()
        for s in self.summaries:
            found = {name: dataclasses.asdict(getattr(s, name)) for name in ("mean", "worst", "perturbed_worst")}
            for figures in found.values():
                for name in ("end_stop", "unstable"):
                    del figures[name]
            summaries.append({"entry": s.entry, **found, "unstable": s.unstable, "end_stops": s.end_stops})
        for o in self.outcomes:
            table = {"perturbed_table": o.table} if o.table >= 0 else {}
            case = {"entry": o.entry, "reference": o.reference, "load": o.load, **table}
            runs.append(case | dataclasses.asdict(o.metrics))
        return {
            "schema": SCHEMA,
            "units": {**UNITS, "load": "kg"},
            "meanings": MEANINGS,
            "settings": dict(self.settings),
            "summaries": summaries,
            "runs": [run for run in runs if "perturbed_table" not in run],
            "perturbed_runs": [run for run in runs if "perturbed_table" in run],
        }

    @property
    def page(self) -> Page:
        """What was found, all controllers side by side, each run."""
        outcomes, summaries = self.outcomes, self.summaries
        best = best_of(summaries)
        lead = f"One set of gains for every reference and load. {self.plant}"
        page = Page("Controllers side by side", lead)
        page.heading("What was found")
        bad = trouble(outcomes)
        cards = [(str(len(outcomes)), "closed loops"), (str(len(bad)), "of them unstable or at an end stop")]
        if best is not None:
            least = percent(summaries[best].worst.position_error)
            cards.insert(0, (least, f"worst position error: {summaries[best].entry}"))
        page.cards(cards)
        page.heading("All controllers")
        page.paragraph(ERRORS)
        page.table(HEAD, summary_rows(summaries), best=best)
        page.subheading("Worst errors over references and loads", detail=True)
        page.paragraph(
            f"Bars start at zero; ▸ marks one that is longer than {LONGEST:g} times the shortest.", note=True
        )
        page.table(("controller", "position", "velocity", "acceleration"), worst_rows(summaries), best=best)
        page.heading("By load")
        head, rows = load_rows(outcomes)
        page.table(head, rows)
        page.heading("Errors and spectra")
        groups = list(self.runs.items())
        for start in range(0, len(groups), TOGETHER):
            part = dict(groups[start : start + TOGETHER])
            page.chart(error_chart(part, self.drawn, start // TOGETHER + 1))
            page.chart(spectrum_chart(part, self.drawn, start // TOGETHER + 1))
        page.heading("Unstable runs and end stops")
        page.paragraph("None." if not bad else f"{len(bad)} runs:")
        if bad:
            page.table(["run"], [[line] for line in bad])
        declared = [o for o in outcomes if o.table < 0]
        for reference in dict.fromkeys(o.reference for o in declared):
            page.heading(f"Reference {reference}", detail=True)
            page.table(CASE_HEAD, case_rows([o for o in declared if o.reference == reference]))
        return page


def compare(
    settings: str | Path = "default",
    *,
    quick: bool = False,
    records: Sequence[str | Path] = (),
    only: Sequence[str] | None = None,
    changes: Mapping[str, Any] | None = None,
    progress: ProgressOption = True,
) -> Comparison:
    """Run every controller of a comparison on its references, loads and perturbed tables.

    Parameters
    ----------
    settings : config/compare/NAME.yaml or a file.
    quick : two references, one load, four perturbed tables.
    records : accelerograms in place of the synthetic earthquakes.
    only : only these controllers of the settings.
    changes : of keys of the settings, `{"table": "bergamo"}` for another plant.
    progress : whether to show it, or a function to call with it.

    Raises
    ------
    ShakeError
        Unknown names, keys that the settings should not have, a record that cannot be read.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.compare(only=["PD"])
    Traceback (most recent call last):
        ...
    shake_ros.quantities.UnknownName: ...
    """
    setup = load_setup(str(settings), changes)
    chosen = _chosen(setup, only)
    with Progress("compare", progress) as bar:
        tracks = _courses(setup, quick, records)
        names = [c.name for c in tracks]
        drawn = setup.settings["figure_reference"] if setup.settings["figure_reference"] in names else names[-1]
        bar.span(0.0, 0.1)
        bar("virtual tables", 0.0)
        todo = _cases(setup, chosen, tracks, quick)
        bar.span(0.1, 1.0)
        outcomes, runs = _run(setup, todo, drawn, bar)
    place = f"reference {drawn}, {setup.settings['figure_load']:g} kg"
    return Comparison({**setup.settings, "references": names}, setup.words(), outcomes, runs, place)


def _chosen(setup: Setup, labels: Sequence[str] | None) -> list[Combination]:
    """The combinations of the settings, or those named."""
    known = combinations(setup)
    for label in labels or ():
        if label not in [c.label for c in known]:
            raise unknown_name("controller", label, [c.label for c in known], setup.where)
    return [c for c in known if labels is None or c.label in labels]


def _courses(setup: Setup, quick: bool, records: Sequence[str | Path]) -> list[Course]:
    """References of the settings; records take the place of its earthquakes."""
    names = setup.settings["quick" if quick else "references"]
    found = setup.courses(names["references"] if quick else names)
    if records:
        found = [c for c in found if c.part.frequency > 0.0] + setup.records([str(record) for record in records])
    return found


def _cases(setup: Setup, chosen: Sequence[Combination], tracks: Sequence[Course], quick: bool) -> list[Case]:
    """Every combination on every reference and load, and on the perturbed tables with the references in turn."""
    small = setup.settings["quick"]
    loads = small["loads"] if quick else setup.settings["loads"]
    others = setup.perturbed(int(small["count"] if quick else setup.settings["perturbed"]["count"]))
    delay = int(setup.settings["delay"])
    result = []
    for entry in chosen:
        for load in loads:
            table = setup.table(load)
            for course in tracks:
                result.append(Case(setup.loop(entry, course, load, table, delay), entry.label, course, load, -1))
        for i, (load, table) in enumerate(others):
            course = tracks[i % len(tracks)]
            result.append(Case(setup.loop(entry, course, load, table, 0), entry.label, course, load, i))
    return result


def _run(
    setup: Setup, todo: Sequence[Case], drawn: str, bar: Callable[[str, float], None]
) -> tuple[list[Outcome], dict[str, ClosedLoop]]:
    """Outcomes of all cases, and the runs of the case that is drawn by controller."""
    kept: dict[str, ClosedLoop] = {}
    load = setup.settings["figure_load"]

    def outcome(index: int, run: ClosedLoop) -> Outcome:
        case = todo[index]
        if case.table < 0 and case.load == load and case.course.name == drawn:
            kept[case.entry] = run
        limit, stroke = case.loop.controller.parameters.limit, case.loop.table.body.stroke
        return Outcome(case.entry, case.course.name, case.load, case.table, judge(run, case.course.part, limit, stroke))

    loops = [case.loop for case in todo]
    found = run_batch(loops, outcome, lambda count: bar(todo[count - 1].entry, count / len(todo)))
    return found, {case.entry: kept[case.entry] for case in todo if case.entry in kept}


def error_chart(runs: Mapping[str, ClosedLoop], case: str = "", part: int = 1) -> Chart:
    """Figure 6.61: position and velocity error of each controller over time."""
    panels = []
    for column, (name, unit) in enumerate(QUANTITIES):
        time = np.arange(max(len(run.command) for run in runs.values())) * next(iter(runs.values())).sample_time
        series = []
        for k, (label, run) in enumerate(runs.items()):
            error = np.full(len(time), np.nan)
            error[: len(run.truth)] = 1e3 * (run.truth[:, column] - run.reference[:, column])
            series.append(ChartSeries(label, error, f"c{k % TOGETHER}"))
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
                series.append(ChartSeries(label, shown(found), f"c{list(runs).index(label) % TOGETHER}"))
        panels.append(Panel(f"{name} [{unit}]", frequency, tuple(series), log=True))
    caption = f"Amplitude spectra of position and velocity{case and f', {case}'}"
    return Chart(f"spectra_{part}", "frequency [Hz]", tuple(panels), caption)


ERRORS = (
    "Errors are the normalised root mean square of the true motion against the reference (J2), mean and worst over "
    "references and loads; J1 is the delay; spectrum is the error of the response spectrum at 5 % damping from 0.5 "
    "to 15 Hz; THD is of the acceleration under sines; travel is of the valve command; perturbed is the worst "
    "position error on the perturbed tables."
)
HEAD = (
    "controller", "J1 [ms]", "position", "worst", "velocity", "worst", "acceleration", "worst", "spectrum", "THD",
    "travel [1/s]", "at limit", "perturbed", "unstable", "end stop",
)  # fmt: skip


number = fixed(2)


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
