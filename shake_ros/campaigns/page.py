"""The page of a campaign: hit rates with their intervals, confusion, spread, time, and an older campaign beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shake_ros.campaigns.rows import FinishedRow
from shake_ros.campaigns.study import Study, StudySection, canonical
from shake_ros.campaigns.tables import against, groups, in_both, numbers, section_table, share, shown
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Made, Page

MOST_FAILED = 50  # listed
MOST_CURVES = 6

NOTES = {
    "shares": "Shares of the rows with their 95 % intervals (Wilson's score).",
    "matrix": "How often each true effect (row) was named as which effect (column).",
    "spread": "Median, quartiles and largest value of each figure.",
    "changes": "Steps of a parameter from reading to reading that exceed its standard errors and its scatter; "
    "the most certain one of each comes first. Correlated parameters may step together.",
}


def campaign_page(
    study: Study,
    rows: Sequence[FinishedRow],
    missing: int,
    older: int,
    version: str,
    other: Sequence[FinishedRow] | None,
    command: str = "",
) -> Page:
    """The whole page.

    Parameters
    ----------
    rows : that are there, in the study's order.
    missing : how many are not.
    older : rows of another version, left out.
    other : rows of an older campaign to compare with.
    command : that made the page.
    """
    page = Page(study.title, f"The study {study.name}: {study.measure} on every row.", Made(command))
    page.heading("What there is")
    failed = [row for row in rows if row.failed is not None]
    hours = math.fsum(row.processor for row in rows) / 3600.0
    page.cards(
        [
            (f"{len(rows)} of {len(rows) + missing}", "rows"),
            (f"{hours:.3g}", "core-hours"),
            (str(len(failed)), "failed"),
        ]
    )
    notes = [f"{missing} rows are missing; the same command continues with them."] if missing else []
    notes += [f"{older} rows of another version of the code or of the study are in the file and not shown."] * (
        older > 0
    )
    page.paragraph(" ".join([f"Version of the code: {version}.", *notes]), note=True)
    for section in study.sections:
        _section(page, section, rows)
    if other is not None:
        _older(page, study, rows, other)
    _time(page, rows)
    if failed:
        page.heading("Rows that failed")
        cells = [[_words(row), str(row.failed)] for row in failed[:MOST_FAILED]]
        page.table(["row", "why"], cells)
        if len(failed) > MOST_FAILED:
            page.paragraph(f"and {len(failed) - MOST_FAILED} more in rows.sqlite.", note=True)
    return page


def _words(row: FinishedRow) -> str:
    return ", ".join(f"{name} {shown(value)}" for name, value in row.given.items())


def _section(page: Page, section: StudySection, rows: Sequence[FinishedRow]) -> None:
    page.heading(section.title)
    page.paragraph(NOTES[section.kind], note=True)
    head, cells = section_table(section, rows)
    if not cells:
        page.paragraph("No row yet.")
        return
    page.table(head, cells)
    if section.kind == "shares" and len(cells) > 1:
        for title, column in section.columns.items():
            page.chart(_share_chart(section, title, column, rows))
    if section.kind == "spread":
        for title, column in section.columns.items():
            if chart := _spread_chart(section, title, column, rows):
                page.chart(chart)


def _share_chart(section: StudySection, title: str, column: str, rows: Sequence[FinishedRow]) -> Chart:
    """A share over its groups with its interval."""
    found = [(values, share(some, column)) for values, some in groups(section, rows)]
    x = np.arange(len(found), dtype=np.float64)
    value = np.array([100.0 * s.value for _, s in found])
    low, high = (np.array([100.0 * s.interval[end] for _, s in found]) for end in (0, 1))
    series = (
        ChartSeries(title, value, "measured", kind="points"),
        ChartSeries("95 % interval, lower end", low, "c0", kind="marks"),
        ChartSeries("upper end", high, "c0", kind="marks"),
    )
    ticks = {float(k): " ".join(map(shown, values)) for k, (values, _) in enumerate(found)}
    panel = Panel(f"{title} [%]", x, series, height=230)
    view = (-0.5, len(found) - 0.5)
    return Chart(
        f"share_{column}", ", ".join(section.by), (panel,), f"{section.title}: {title}", ticks=ticks, view=view
    )


def _spread_chart(section: StudySection, title: str, column: str, rows: Sequence[FinishedRow]) -> Chart | None:
    """The sorted values of each group over the share of rows that stay below."""
    found = [(v, n) for v, some in groups(section, rows) if len(n := numbers(some, column)) > 1][:MOST_CURVES]
    if not found:
        return None
    share_of_rows = np.linspace(0.0, 100.0, 101)
    curves = [
        ChartSeries(" ".join(map(shown, values)) or title, np.quantile(n, share_of_rows / 100.0), f"c{k}", width=1.6)
        for k, (values, n) in enumerate(found)
    ]
    log = all(n[0] > 0.0 and n[-1] > 30.0 * n[0] for _, n in found)
    panel = Panel(title, share_of_rows, tuple(curves), log=log, height=230)
    return Chart(f"spread_{column}", "rows below [%]", (panel,), f"{section.title}: {title}")


def _older(page: Page, study: Study, rows: Sequence[FinishedRow], other: Sequence[FinishedRow]) -> None:
    page.heading("Comparison with the older campaign")
    here, there = in_both(rows, other)
    if not here:
        page.paragraph("No row is in both.")
        return
    same = [
        canonical(a.figures) == canonical(b.figures) and a.failed == b.failed for a, b in zip(here, there, strict=True)
    ]
    page.paragraph(f"{len(here)} rows are in both; {sum(same)} are the same to the last bit.")
    head, cells = against(rows, other, study.sections)
    if cells:
        page.table(head, cells)
    changed = [pair for pair, equal in zip(zip(here, there, strict=True), same, strict=True) if not equal]
    if changed:
        page.subheading("Rows that differ")
        cells = [[_words(a), _difference(a, b)] for a, b in changed[:MOST_FAILED]]
        page.table(["row", "older → here"], cells)


def _difference(here: FinishedRow, there: FinishedRow) -> str:
    if here.figures is None or there.figures is None:
        return f"{there.failed or 'finished'} → {here.failed or 'finished'}"
    names = [n for n in here.figures if here.figures[n] != there.figures.get(n)]
    short = [n for n in names if not isinstance(here.figures[n], dict | list) or len(canonical(here.figures[n])) < 60]
    texts = [f"{n}: {shown(there.figures.get(n))} → {shown(here.figures[n])}" for n in short[:4]]
    return "; ".join(texts) or ", ".join(names)


def _time(page: Page, rows: Sequence[FinishedRow]) -> None:
    seconds = np.sort([row.processor for row in rows if row.failed is None])
    page.heading("Time")
    if not len(seconds):
        page.paragraph("No row yet.")
        return
    median, longest, total = float(np.median(seconds)), float(seconds[-1]), float(seconds.sum())
    page.paragraph(
        f"Processor time of a row: median {median:.3g} s, longest {longest:.3g} s; "
        f"all rows together {total / 3600.0:.3g} core-hours."
    )
    if len(seconds) > 1:
        at = np.linspace(0.0, 100.0, 101)
        curve = ChartSeries("processor time", np.quantile(seconds, at / 100.0), "c0", width=1.6)
        panel = Panel("of a row [s]", at, (curve,), log=bool(seconds[-1] > 30.0 * seconds[0] > 0.0))
        page.chart(Chart("time", "rows below [%]", (panel,), "Processor time of the rows, sorted"))
