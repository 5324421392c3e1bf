"""The page of a comparison of controllers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.loop.metrics import Outcome, Summary, summarise
from shake_ros.report.charts_comparison import error_chart, spectrum_chart
from shake_ros.report.comparison_text import HEAD, load_rows, number, summary_rows, trouble
from shake_ros.report.page import Bar, Made, Page
from shake_ros.report.style import COLOURS
from shake_ros.report.text import percent

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
    runs : of the case that is drawn, by controller. figure_case : that case in words. plant : the plant in words.
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
    for start in range(0, len(groups), len(COLOURS)):
        part = dict(groups[start : start + len(COLOURS)])
        page.chart(error_chart(part, figure_case, start // len(COLOURS) + 1))
        page.chart(spectrum_chart(part, figure_case, start // len(COLOURS) + 1))
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
