"""`campaign`: a study of many independent fits or loops, here or on a cluster, that can be resumed."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.campaigns.batches import Task, TaskOutcome, code_version, run
from shake_ros.campaigns.engine import engine
from shake_ros.campaigns.rows import CampaignFile, FinishedRow
from shake_ros.campaigns.study import Study, StudySection, canonical, load_study
from shake_ros.campaigns.tables import against, groups, in_both, numbers, section_table, share, shown
from shake_ros.core.quantities import ShakeError
from shake_ros.data.result_folder import writing
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Made, Page, write_page
from shake_ros.report.result_table import ResultTable


@dataclass(frozen=True, repr=False)
class Campaign:
    """The rows of a study that are there.

    Attributes
    ----------
    study : what was asked.
    folder : with rows.sqlite.
    rows : finished ones of this version, in the study's order.
    missing : rows that are not there yet.
    older : rows in the file that are of another version or study.
    version : of the code.
    """

    study: Study
    folder: Path
    rows: Sequence[FinishedRow]
    missing: int
    older: int
    version: str

    @property
    def failed(self) -> list[FinishedRow]:
        """The rows that failed."""
        return [row for row in self.rows if row.failed is not None]

    @property
    def frame(self) -> ResultTable:
        """Every row: what was given, what was measured, why it failed."""
        given = list(dict.fromkeys(name for row in self.rows for name in row.given))
        figures = list(dict.fromkeys(name for row in self.rows for name in row.figures or () if name not in given))
        cells = [
            (*(row.given.get(n) for n in given), *((row.figures or {}).get(n) for n in figures), row.failed)
            for row in self.rows
        ]
        return ResultTable((*given, *figures, "failed"), cells)

    @property
    def tables(self) -> dict[str, ResultTable]:
        """The tables of the report by title."""
        found = {}
        for section in self.study.sections:
            head, cells = section_table(section, self.rows)
            found[section.title] = ResultTable(head, cells)
        return found

    def report(self, compare: str | Path | None = None, *, figures: str | None = None, command: str = "") -> Path:
        """Write report.html into the folder; `compare` with the folder of an older campaign of the same study.

        `figures` adds static copies of the charts, as "pdf", "svg" or "png"; `command` is the line that the page names.
        """
        other = None if compare is None else rows_of(compare, self.study)
        page = campaign_page(self, other, command)
        with writing():
            write_page(page, self.folder, figures)
        return self.folder / "report.html"

    def __repr__(self) -> str:
        seconds = math.fsum(row.processor for row in self.rows)
        counts = [f"{len(self.rows)} of {len(self.rows) + self.missing} rows, {seconds / 3600.0:.3g} core-hours"]
        counts += [f"{len(self.failed)} failed: {_reasons(self.failed)}"] if self.failed else []
        counts += [f"{self.older} more in the file, of another version of the code or of the study"] * (self.older > 0)
        tables = [f"\n{title}\n{table}" for title, table in self.tables.items()]
        return "\n".join([self.study.title, *counts, *tables])


def _reasons(failed: Sequence[FinishedRow]) -> str:
    reasons = [str(row.failed) for row in failed]
    most = sorted(set(reasons), key=lambda text: (-reasons.count(text), text))
    more = f", and {len(most) - 3} more" if len(most) > 3 else ""
    return "; ".join(f"{text} ({reasons.count(text)})" for text in most[:3]) + more


def campaign(
    study: str | Path,
    out: str | Path,
    *,
    engine: str | None = None,
    workers: int | None = None,
    changes: Mapping[str, Any] | None = None,
    minutes: float | None = None,
    retry: bool = False,
    progress: ProgressOption = True,
) -> Campaign:
    """Run the rows of a study that are not there yet; each is written as soon as it is finished.

    An interrupted campaign continues where it stopped. A row is identified by its measure, values, the content of
    its files and the code that makes it, and none is run twice.

    Parameters
    ----------
    study : config/studies/NAME.yaml or a file.
    out : folder of the rows, new or of the same study.
    engine : address of a Dask scheduler, tls://HOST:PORT, or tcp://HOST:PORT on this machine; without one, processes of
        this machine.
    workers : how many of them, by default one for each core.
    changes : other values of the study's names.
    minutes : after which no further row is begun; 0 runs none.
    retry : run the rows again that failed.
    progress : whether to show it, or a function to call with it.

    Raises
    ------
    ShakeError
        An inconsistent study, a folder of something else, an engine that is refused or does not answer.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.campaign("no_such_study", "out/none")
    Traceback (most recent call last):
        ...
    shake_ros.core.quantities.UnknownName: ...
    """
    asked = load_study(str(study), changes)
    version = code_version(asked.measure)
    with CampaignFile(Path(out), asked.measure) as file:
        file.describe(study=canonical(asked.content), name=asked.name)
        if retry:
            file.forget_failed(version)
        last = math.inf if minutes is None else time.monotonic() + 60.0 * minutes
        if minutes is None or minutes > 0.0:
            with Progress("campaign", progress) as bar:
                _run_missing(_Work(asked, file, version, last, bar), engine, workers)
        return _found(asked, file, Path(out), version)


class _Work:
    """The remaining rows of a study, and its progress."""

    def __init__(self, study: Study, file: CampaignFile, version: str, last: float, bar: Progress) -> None:
        self.study, self._file, self._version, self._last, self._bar = study, file, version, last, bar
        self._count = sum(1 for _ in study.rows())
        self._there = self._made = self._failed = 0
        self._begun = time.monotonic()

    def tasks(self) -> Iterator[Task]:
        """The rows that are not in the file, until the time is over."""
        for row in self.study.rows():
            key = self.study.key(row, self._version)
            if key in self._file:
                self._there += 1
            elif time.monotonic() > self._last:
                return
            else:
                yield Task(key, row)

    def keep(self, outcomes: Sequence[TaskOutcome]) -> None:
        """Write finished rows and report the progress."""
        self._file.add((o.task.key, canonical(o.task.given), self._version, *o[1:]) for o in outcomes)
        self._made += len(outcomes)
        self._failed += sum(o.failed is not None for o in outcomes)
        done = self._there + self._made
        left = (time.monotonic() - self._begun) / self._made * (self._count - done)
        failed = f", {self._failed} failed" if self._failed else ""
        self._bar(f"{done} of {self._count}{failed}, {_duration(left)} left", done / self._count)


def _run_missing(work: _Work, address: str | None, workers: int | None) -> None:
    tasks = work.tasks()
    first = next(tasks, None)
    if first is None:
        return  # no process is started for nothing

    def left() -> Iterator[Task]:
        yield first
        yield from tasks

    with engine(address, workers) as chosen, closing(run(chosen, work.study.measure, left())) as batches:
        for outcomes in batches:
            work.keep(outcomes)


def _found(study: Study, file: CampaignFile, folder: Path, version: str) -> Campaign:
    rows = [file.row(study.key(given, version)) for given in study.rows()]
    there = [row for row in rows if row is not None]
    return Campaign(study, folder, there, len(rows) - len(there), len(file) - len(there), version)


def rows_of(folder: str | Path, study: Study) -> list[FinishedRow]:
    """The rows of an older campaign of the same study, each with the newest version that it has."""
    with CampaignFile(Path(folder), write=False) as file:
        if file.measure != study.measure:
            raise ShakeError(f"{folder}: holds rows of another study, of {file.measure}")
        return list({json.dumps(row.given, sort_keys=True): row for row in file}.values())


def _duration(seconds: float) -> str:
    """A time for people.

    >>> _duration(42.0), _duration(600.0), _duration(30000.0)
    ('42 s', '10 min', '8.3 h')
    """
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


MOST_FAILED = 50  # listed
MOST_CURVES = 6

NOTES = {
    "shares": "Shares of the rows with their 95 % intervals (Wilson's score).",
    "matrix": "How often each true effect (row) was named as which effect (column).",
    "spread": "Median, quartiles and largest value of each figure.",
    "rate": "Events in 100 of what they are counted over, with the 95 % interval of a Poisson process.",
}


def campaign_page(found: Campaign, other: Sequence[FinishedRow] | None, command: str = "") -> Page:
    """The whole page; other : rows of an older campaign to compare with."""
    study, rows, missing, older, failed = found.study, found.rows, found.missing, found.older, found.failed
    page = Page(study.title, f"The study {study.name}: {study.measure} on every row.", Made(command))
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
    page.paragraph(" ".join([f"Version of the code: {found.version}.", *notes]), note=True)
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
