"""`campaign`: a study of many independent fits or loops, here or on a cluster, that can be resumed.

The rows are in one SQLite file: each written as it comes, none twice, safe against any end.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import datetime, timezone
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any

from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.campaigns.batches import Task, TaskOutcome, code_version, run
from shake_ros.campaigns.engine import engine
from shake_ros.campaigns.report import campaign_page, section_table
from shake_ros.campaigns.study import Study, canonical, load_study
from shake_ros.quantities import ShakeError
from shake_ros.report.page import write_page
from shake_ros.report.result_table import ResultTable
from shake_ros.result_folder import writing

FILE = "rows.sqlite"
LAYOUT = 1
TABLES = """
CREATE TABLE campaign (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE rows (
    key TEXT PRIMARY KEY,         -- hash of measure, values, content of files, code
    given TEXT NOT NULL,          -- the row's values, JSON
    version TEXT NOT NULL,        -- of the code
    figures TEXT,                 -- what was measured, JSON; NULL where it failed
    failed TEXT,                  -- why
    seconds REAL NOT NULL,        -- by the clock
    processor REAL NOT NULL,      -- of the processor [s]
    worker TEXT NOT NULL,         -- machine and process
    finished TEXT NOT NULL        -- UTC
) WITHOUT ROWID;
"""


@dataclass(frozen=True)
class FinishedRow:
    """A row with what was measured."""

    given: Mapping[str, Any]  # its values
    figures: Mapping[str, Any] | None  # measured, None where it failed
    failed: str | None  # why
    # seconds, processor: by the clock, of the processor [s]
    seconds: float
    processor: float
    version: str  # of the code

    def value(self, column: str) -> Any:
        """A figure or, where there is none of that name, a value that was given."""
        if self.figures is not None and column in self.figures:
            return self.figures[column]
        return self.given.get(column)


class CampaignFile:
    """The file of a campaign, opened by one process at a time; use it in a `with`.

    Parameters
    ----------
    folder : of the campaign.
    measure : what its rows are of; a folder with rows of another study is refused.
    write : make the folder and keep others out.
    """

    def __init__(self, folder: Path, measure: str | None = None, *, write: bool = True) -> None:
        self._path, self._lock = folder / FILE, -1
        others = folder.exists() and any(p.name[0] != "." for p in folder.iterdir())
        if not self._path.exists() and (others or not write):
            raise ShakeError(f"{folder}: is not a folder of a campaign: it has no {FILE}")
        try:
            if write:
                folder.mkdir(parents=True, exist_ok=True)
                self._lock = _locked(folder)
            mode = "rwc" if write else "ro"
            self._base = sqlite3.connect(
                f"{self._path.absolute().as_uri()}?mode={mode}", uri=True, isolation_level=None
            )
            self._base.execute("PRAGMA busy_timeout = 10000")
            if write:
                self._begin(measure or "")
            self.measure = self.meta("measure")
            if self.meta("layout") != str(LAYOUT):
                raise ShakeError(f"{self._path}: is written by another version of the program")
            if measure is not None and self.measure != measure:
                raise ShakeError(f"{folder}: holds rows of another study, of {self.measure}")
        except (OSError, sqlite3.Error) as error:
            self._unlock()
            raise ShakeError(f"{self._path}: cannot be used ({error})") from None
        except ShakeError:
            self._unlock()
            raise

    def _begin(self, measure: str) -> None:
        self._base.execute("PRAGMA journal_mode = WAL")
        self._base.execute("PRAGMA synchronous = NORMAL")
        if self._base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0] == 0:
            self._base.executescript(f"BEGIN; {TABLES} COMMIT;")
            self.describe(layout=str(LAYOUT), measure=measure)

    def _unlock(self) -> None:
        if self._lock >= 0:
            os.close(self._lock)

    def __enter__(self) -> CampaignFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._base.close()
        self._unlock()

    def meta(self, name: str) -> str:
        """A property of the campaign; empty where there is none."""
        found = self._base.execute("SELECT value FROM campaign WHERE name = ?", (name,)).fetchone()
        return found[0] if found else ""

    def describe(self, **values: str) -> None:
        """Store a property of the campaign."""
        with self._at_once():
            self._base.executemany("INSERT OR REPLACE INTO campaign VALUES (?, ?)", values.items())

    def __contains__(self, key: str) -> bool:
        return self._base.execute("SELECT 1 FROM rows WHERE key = ?", (key,)).fetchone() is not None

    def add(self, rows: Iterable[tuple[str, str, str, str | None, str | None, float, float, str]]) -> None:
        """Write rows: key, given, version, figures, failed, seconds, processor, worker; all or none."""
        now = datetime.now(timezone.utc).isoformat(timespec="seconds")
        with self._at_once():
            self._base.executemany("INSERT INTO rows VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", [(*r, now) for r in rows])

    def forget_failed(self, version: str) -> int:
        """Take out the rows that failed with a version; returns how many."""
        with self._at_once():
            return self._base.execute("DELETE FROM rows WHERE failed IS NOT NULL AND version = ?", (version,)).rowcount

    def row(self, key: str) -> FinishedRow | None:
        """A row by its key."""
        found = self._base.execute(f"SELECT {_COLUMNS} FROM rows WHERE key = ?", (key,)).fetchone()
        return None if found is None else _row(found)

    def __iter__(self) -> Iterator[FinishedRow]:
        """All rows, of every version."""
        for found in self._base.execute(f"SELECT {_COLUMNS} FROM rows ORDER BY finished, key"):
            yield _row(found)

    def __len__(self) -> int:
        return int(self._base.execute("SELECT count(*) FROM rows").fetchone()[0])

    @contextmanager
    def _at_once(self) -> Iterator[None]:
        try:
            self._base.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                self._base.execute("ROLLBACK")
                raise
            self._base.execute("COMMIT")
        except sqlite3.Error as error:
            raise ShakeError(f"{self._path}: cannot be written ({error})") from None


_COLUMNS = "given, figures, failed, seconds, processor, version"


def _row(found: tuple[Any, ...]) -> FinishedRow:
    given, figures, *rest = found
    return FinishedRow(json.loads(given), None if figures is None else json.loads(figures), *rest)


def _locked(folder: Path) -> int:
    """A lock that ends with the process, however that ends."""
    handle = os.open(folder / ".lock", os.O_CREAT | os.O_RDWR, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise ShakeError(f"{folder}: another campaign is running in it") from None
    return handle


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
        return {section.title: section_table(section, self.rows) for section in self.study.sections}

    def report(self, compare: str | Path | None = None, *, figures: str | None = None, command: str = "") -> Path:
        """Write report.html into the folder; `compare` with the folder of an older campaign of the same study.

        `figures` adds static copies of the charts, as "pdf", "svg" or "png"; `command` is the line that the page names.
        """
        other = None if compare is None else rows_of(compare, self.study)
        page = campaign_page(self, other)
        with writing():
            write_page(page, self.folder, figures, command=command)
        return self.folder / "report.html"

    def __repr__(self) -> str:
        return campaign_page(self).text()


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
    workers : processes on this machine; one for each core where not given.
    changes : other values of the study's names.
    minutes : begin no row after so many minutes; 0 runs none.
    retry : run failed rows again.
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
    shake_ros.quantities.UnknownName: ...
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

    left = chain([first], tasks)
    with engine(address, workers) as chosen, closing(run(chosen, work.study.measure, left)) as batches:
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
