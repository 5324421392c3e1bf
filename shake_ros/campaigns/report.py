"""The report of a campaign, from its rows: shares with intervals, confusion, spread, against an older one."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.stats import binomtest, chi2

from shake_ros.campaigns.study import Study, StudySection, canonical
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Page
from shake_ros.report.result_table import ResultTable, plain

if TYPE_CHECKING:
    from shake_ros.campaigns.campaign import Campaign, FinishedRow


class Share(NamedTuple):
    """Cases that are so, of how many."""

    hits: int
    of: int

    @property
    def value(self) -> float:
        """The share [-]; nan of no case."""
        return self.hits / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the true share by Wilson's score.

        E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209: the shares p with |h − p| ≤ z √(p (1 − p)/n).

        >>> [round(end, 4) for end in Share(9, 10).interval]
        [0.5958, 0.9821]
        >>> Share(0, 0).interval
        (0.0, 1.0)
        """
        if self.of == 0:
            return 0.0, 1.0
        low, high = binomtest(self.hits, self.of).proportion_ci(method="wilson")
        return float(low), float(high)

    def __str__(self) -> str:
        """
        >>> print(Share(9, 10))
        90.0 % of 10 (59.6 … 98.2 %)
        """
        if self.of == 0:
            return "no case"
        low, high = self.interval
        return f"{100 * self.value:.1f} % of {self.of} ({100 * low:.1f} … {100 * high:.1f} %)"


def looked_at(section: StudySection, rows: Sequence[FinishedRow]) -> list[FinishedRow]:
    """The rows of a section that did not fail, or the entries of their lists."""
    good = [row for row in rows if row.figures is not None]
    if section.of:
        good = [
            replace(row, figures={**(row.figures or {}), **entry}) for row in good for entry in _entries(row, section)
        ]
    wanted = section.where or {}
    return [row for row in good if all(_is(row.value(name), value) for name, value in wanted.items())]


def _entries(row: FinishedRow, section: StudySection) -> Sequence[Mapping[str, Any]]:
    found = row.value(section.of)
    return found if isinstance(found, list) and all(isinstance(e, dict) for e in found) else ()


def _is(value: Any, wanted: Any) -> bool:
    return value in wanted if isinstance(wanted, list) else bool(value == wanted)


def groups(section: StudySection, rows: Sequence[FinishedRow]) -> Iterator[tuple[tuple[Any, ...], list[FinishedRow]]]:
    """The rows of a section by the values of its columns `by`, sorted; all together where there are none."""
    found: dict[tuple[Any, ...], list[FinishedRow]] = {}
    for row in looked_at(section, rows):
        found.setdefault(tuple(_plain(row.value(name)) for name in section.by), []).append(row)
    for values in sorted(
        found, key=lambda v: tuple((isinstance(x, str), x) if x is not None else (True, "") for x in v)
    ):
        yield values, found[values]


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, str | int | float | bool) else plain(value)


def share(rows: Sequence[FinishedRow], column: str) -> Share:
    """Of the rows where a column says so or not, how many say so."""
    answers = [bool(v) for row in rows if (v := row.value(column)) is not None]
    return Share(sum(answers), len(answers))


def numbers(rows: Sequence[FinishedRow], column: str) -> np.ndarray:
    """The finite numbers of a column, sorted, shape (n,)."""
    values = [row.value(column) for row in rows]
    return np.sort([float(v) for v in values if isinstance(v, int | float) and math.isfinite(v)])


def section_table(section: StudySection, rows: Sequence[FinishedRow]) -> ResultTable:
    """The table of a section."""
    return _TABLES[section.kind](section, rows)


def _shares(section: StudySection, rows: Sequence[FinishedRow]) -> ResultTable:
    cells = [
        [*values, *(str(share(some, column)) for column in section.columns.values())]
        for values, some in groups(section, rows)
    ]
    return ResultTable([*section.by, *section.columns], cells)


def _matrix(section: StudySection, rows: Sequence[FinishedRow]) -> ResultTable:
    truth, named = section.columns["truth"], section.columns["named"]
    counts: dict[tuple[str, ...], Counter[str]] = {}
    for values, some in groups(replace(section, by=(truth, *section.by)), rows):
        counts[tuple(map(plain, values))] = Counter(plain(row.value(named)) for row in some)
    names = sorted({name for counter in counts.values() for name in counter})
    order = [n for n in dict.fromkeys(v[0] for v in counts) if n in names]
    order += [n for n in names if n not in order]
    cells = [[*values, *(counter[n] or "" for n in order)] for values, counter in counts.items()]
    return ResultTable([truth, *section.by, *order], cells)


def _spread(section: StudySection, rows: Sequence[FinishedRow]) -> ResultTable:
    cells = []
    for values, some in groups(section, rows):
        for title, column in section.columns.items():
            found = numbers(some, column)
            low, middle, high = np.quantile(found, [0.25, 0.5, 0.75]) if len(found) else [math.nan] * 3
            largest = found[-1] if len(found) else math.nan
            cells.append([*values, title, len(found), middle, low, high, largest])
    head = (*section.by, "figure", "rows", "median", "lower quartile", "upper quartile", "largest")
    return ResultTable(head, cells)


class Rate(NamedTuple):
    """Events over a time, or over whatever else they may come in."""

    events: int
    over: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the true rate of a Poisson process.

        F. Garwood, Biometrika 28 (1936) 437: the rates at which so few, or so many, have a chance of 2.5 %.

        >>> [round(end, 3) for end in Rate(0, 1.0).interval], [round(end, 3) for end in Rate(2, 1.0).interval]
        ([0.0, 3.689], [0.242, 7.225])
        """
        low = 0.5 * float(chi2.ppf(0.025, 2 * self.events)) if self.events else 0.0
        return low / self.over, 0.5 * float(chi2.ppf(0.975, 2 * self.events + 2)) / self.over


def _rate(section: StudySection, rows: Sequence[FinishedRow]) -> ResultTable:
    events, over = section.columns["events"], section.columns["over"]
    cells = []
    for values, some in groups(section, rows):
        rate = Rate(round(float(np.sum(numbers(some, events)))), float(np.sum(numbers(some, over))))
        known = [f"{100.0 * r:.3g}" for r in (rate.events / rate.over, *rate.interval)] if rate.over else [None] * 3
        cells.append([*values, rate.events, rate.over, *known])
    return ResultTable([*section.by, events, over, "in 100", "at least", "at most"], cells)


_TABLES: dict[str, Callable[[StudySection, Sequence[FinishedRow]], ResultTable]] = {
    "shares": _shares,
    "matrix": _matrix,
    "spread": _spread,
    "rate": _rate,
}


def against(rows: Sequence[FinishedRow], other: Sequence[FinishedRow], sections: Sequence[StudySection]) -> ResultTable:
    """Shares and medians here and in an older campaign, over the rows that both have."""
    here, there = in_both(rows, other)
    cells = []
    for section in sections:
        if section.kind not in ("shares", "spread"):
            continue
        first, second = (dict(groups(section, side)) for side in (here, there))
        for values, (title, column) in itertools.product(first, section.columns.items()):
            pair = first[values], second.get(values, [])
            if section.kind == "shares":
                texts: list[str | None] = [str(share(some, column)) for some in pair]
            else:
                texts = [
                    f"median {np.median(n):.4g} of {len(n)}" if len(n := numbers(s, column)) else None for s in pair
                ]
            cells.append([section.title, ", ".join(map(plain, values)), title, *texts])
    return ResultTable(("section", "group", "figure", "here", "older"), cells)


def in_both(rows: Sequence[FinishedRow], other: Sequence[FinishedRow]) -> tuple[list[FinishedRow], list[FinishedRow]]:
    """The rows whose values both have, in one order."""
    older = {canonical(row.given): row for row in other}
    pairs = [(row, older[text]) for row in rows if (text := canonical(row.given)) in older]
    return [a for a, _ in pairs], [b for _, b in pairs]


MOST_FAILED = 50  # listed
MOST_CURVES = 6

NOTES = {
    "shares": "Shares of the rows with their 95 % intervals (Wilson's score).",
    "matrix": "How often each true effect (row) was named as which effect (column).",
    "spread": "Median, quartiles and largest value of each figure.",
    "rate": "Events in 100 of what they are counted over, with the 95 % interval of a Poisson process.",
}


def campaign_page(found: Campaign, other: Sequence[FinishedRow] | None = None) -> Page:
    """The whole page; other : rows of an older campaign to compare with."""
    study, rows, missing, older, failed = found.study, found.rows, found.missing, found.older, found.failed
    page = Page(study.title, f"The study {study.name}: {study.measure} on every row.")
    page.heading("What there is")
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
    page.paragraph(" ".join([f"Version of the code: {found.version}.", *notes]))
    for section in study.sections:
        _section(page, section, rows)
    if other is not None:
        _older(page, study, rows, other)
    _time(page, rows)
    if failed:
        page.heading("Rows that failed")
        page.paragraph(f"{len(failed)} failed: {_reasons(failed)}.")
        page.subheading("One by one", detail=True)
        cells = [[_words(row), str(row.failed)] for row in failed[:MOST_FAILED]]
        page.table(["row", "why"], cells)
        if len(failed) > MOST_FAILED:
            page.paragraph(f"and {len(failed) - MOST_FAILED} more in rows.sqlite.", note=True)
    return page


def _reasons(failed: Sequence[FinishedRow]) -> str:
    reasons = [str(row.failed) for row in failed]
    most = sorted(set(reasons), key=lambda text: (-reasons.count(text), text))
    more = f", and {len(most) - 3} more" if len(most) > 3 else ""
    return "; ".join(f"{text} ({reasons.count(text)})" for text in most[:3]) + more


def _words(row: FinishedRow) -> str:
    return ", ".join(f"{name} {plain(value)}" for name, value in row.given.items())


def _section(page: Page, section: StudySection, rows: Sequence[FinishedRow]) -> None:
    page.heading(section.title)
    page.paragraph(NOTES[section.kind], note=True)
    table = section_table(section, rows)
    if not table.rows:
        page.paragraph("No row yet.")
        return
    page.result(table)
    if section.kind == "shares" and len(table.rows) > 1:
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
    ticks = {float(k): " ".join(map(plain, values)) for k, (values, _) in enumerate(found)}
    panel = Panel(f"{title} [%]", x, series, height=230)
    view = (-0.5, len(found) - 0.5)
    return Chart(
        f"share_{column}", ", ".join(section.by), (panel,), f"{section.title}: {title}", ticks=ticks, view=view
    )


def _spread_chart(section: StudySection, title: str, column: str, rows: Sequence[FinishedRow]) -> Chart | None:
    found = [(v, n) for v, some in groups(section, rows) if len(n := numbers(some, column)) > 1][:MOST_CURVES]
    curves = [(" ".join(map(plain, values)) or title, n) for values, n in found]
    return _sorted_chart(f"spread_{column}", title, curves, f"{section.title}: {title}", 230) if curves else None


def _sorted_chart(name: str, title: str, curves: Sequence[tuple[str, np.ndarray]], caption: str, height: int) -> Chart:
    """The sorted values of each group over the share of rows that stay below."""
    share_of_rows = np.linspace(0.0, 100.0, 101)
    series = [
        ChartSeries(label, np.quantile(values, share_of_rows / 100.0), f"c{k}", width=1.6)
        for k, (label, values) in enumerate(curves)
    ]
    log = all(values[0] > 0.0 and values[-1] > 30.0 * values[0] for _, values in curves)
    panel = Panel(title, share_of_rows, tuple(series), log=log, height=height)
    return Chart(name, "rows below [%]", (panel,), caption)


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
    shares = against(rows, other, study.sections)
    if shares.rows:
        page.result(shares)
    changed = [pair for pair, equal in zip(zip(here, there, strict=True), same, strict=True) if not equal]
    if changed:
        page.subheading("Rows that differ", detail=True)
        cells = [[_words(a), _difference(a, b)] for a, b in changed[:MOST_FAILED]]
        page.table(["row", "older → here"], cells)


def _difference(here: FinishedRow, there: FinishedRow) -> str:
    if here.figures is None or there.figures is None:
        return f"{there.failed or 'finished'} → {here.failed or 'finished'}"
    names = [n for n in here.figures if here.figures[n] != there.figures.get(n)]
    short = [n for n in names if not isinstance(here.figures[n], dict | list) or len(canonical(here.figures[n])) < 60]
    texts = [f"{n}: {plain(there.figures.get(n))} → {plain(here.figures[n])}" for n in short[:4]]
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
        curve = [("processor time", seconds)]
        page.chart(_sorted_chart("time", "of a row [s]", curve, "Processor time of the rows, sorted", 190))
