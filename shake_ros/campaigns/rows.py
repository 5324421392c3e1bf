"""The rows of a campaign in one SQLite file: each written as it comes, none twice, safe against any end."""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from types import TracebackType
from typing import Any

from shake_ros.core.quantities import ShakeError

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
    """A row with what was measured.

    Attributes
    ----------
    given : its values.
    figures : measured, None where it failed.
    failed : why.
    seconds, processor : by the clock, of the processor [s].
    version : of the code.
    """

    given: Mapping[str, Any]
    figures: Mapping[str, Any] | None
    failed: str | None
    seconds: float
    processor: float
    version: str

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
