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

from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.campaigns.batches import Task, TaskOutcome, code_version, run
from shake_ros.campaigns.engine import engine
from shake_ros.campaigns.rows import CampaignFile, FinishedRow
from shake_ros.campaigns.study import Study, canonical, load_study
from shake_ros.campaigns.tables import section_table
from shake_ros.core.quantities import ShakeError
from shake_ros.data.result_folder import writing
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
        from shake_ros.campaigns.page import campaign_page
        from shake_ros.report.page import write_page

        other = None if compare is None else rows_of(compare, self.study)
        page = campaign_page(self.study, self.rows, self.missing, self.older, self.version, other, command)
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
