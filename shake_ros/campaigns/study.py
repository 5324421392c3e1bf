"""A study: what varies, what is measured, what is reported; config/studies/NAME.yaml or a file of one's own."""

from __future__ import annotations

import hashlib
import inspect
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shake_ros.campaigns.batches import function_of
from shake_ros.quantities import ShakeError, shown, strict_keys, unknown_name
from shake_ros.settings import find, read_yaml

KEYS = ("title", "measure", "rows", "same", "files", "order", "report")
ORDERS = ("listed", "chance")
NEEDED = ("title", "measure", "rows")
RANGE = ("first", "last")
LISTED = ("list", "with")
LARGEST = 5_000_000  # rows
SECTIONS = ("shares", "matrix", "spread", "rate")
NAMED = {"matrix": ("truth", "named"), "rate": ("events", "over")}

Row = Mapping[str, Any]


@dataclass(frozen=True)
class StudySection:
    """A part of the report."""

    kind: str  # of SECTIONS
    title: str  # of the section
    columns: Mapping[str, str]  # of the figures; the kind says what for
    by: tuple[str, ...] = ()  # columns whose values make groups
    where: Mapping[str, Any] | None = None  # values that rows must have
    # column with a list of entries in each row, which are then looked at in the rows' place; empty for the rows
    of: str = ""


@dataclass(frozen=True)
class Study:
    """What is to be run."""

    name: str  # of the study
    where: str  # its file
    content: Mapping[str, Any]  # of the file, with what was changed
    title: str  # a sentence
    measure: str  # `module:function`, which takes a row's values by name
    files: tuple[str, ...]  # names of values that are paths, whose content counts
    sections: tuple[StudySection, ...]  # of the report

    def rows(self) -> Iterator[Row]:
        """The rows in the study's order, each once.

        By `order: chance` they are shuffled, always alike: what is finished at any time is a sample of the whole.
        """
        if self.content.get("order", "listed") == "listed":
            yield from self._listed_rows()
        else:
            yield from sorted(self._listed_rows(), key=lambda row: hashlib.sha256(canonical(row).encode()).digest())

    def _listed_rows(self) -> Iterator[Row]:
        same = self.content.get("same") or {}
        seen = set()
        for number, block in enumerate(self.content["rows"]):
            where = f"{self.where}: rows: {number + 1}"
            for varied in _listed(block, where) if "list" in block else _product(block):
                row = {**same, **varied}
                own = hashlib.sha256(canonical(row).encode()).digest()[:16]
                if own not in seen:
                    seen.add(own)
                    yield row

    def key(self, row: Row, version: str) -> str:
        """What identifies a row: what is measured, its values, the content of its files, the code."""
        text = canonical([self.measure, row, [content_hash(row[name]) for name in self.files], version])
        return hashlib.sha256(text.encode()).hexdigest()[:32]


def canonical(value: Any) -> str:
    """A value as JSON text that does not depend on the order of keys."""
    return json.dumps(value, sort_keys=True, allow_nan=False, separators=(",", ":"))


def content_hash(path: Any) -> str:
    """Hash of a file, or of all files of a folder with their names; empty for a name of config/, which is code."""
    if _is_name(path):
        return ""
    whole = Path(str(path))
    files = sorted(p for p in whole.rglob("*") if p.is_file()) if whole.is_dir() else [whole]
    digest = hashlib.sha256()
    for file in files:
        try:
            with file.open("rb") as stream:
                inner = hashlib.sha256()
                while part := stream.read(1 << 20):
                    inner.update(part)
        except OSError as error:
            raise ShakeError(f"{file}: cannot be read ({error.strerror})") from None
        digest.update(f"{file.relative_to(whole)}\n".encode() + inner.digest())
    return digest.hexdigest()


def _is_name(path: Any) -> bool:
    """Whether a value is no path but the name of a configuration."""
    return not Path(str(path)).exists() and not {"/", "."} & set(str(path))


def load_study(name: str, changes: Mapping[str, Any] | None = None) -> Study:
    """The study of config/studies/NAME.yaml or of a file.

    Parameters
    ----------
    changes : other values of what varies, of what is the same in every row, or of what a list is made with, by name.

    Raises
    ------
    ShakeError : a line that names the file, the key and what is wrong with it.
    """
    path = find("studies", name)
    return study_of(read_yaml(path), path.stem, str(path), changes or {})


def study_of(content: Any, name: str, where: str, changes: Mapping[str, Any]) -> Study:
    """The study of a file's content."""
    given = dict(strict_keys(content, KEYS, where, NEEDED, kind="key"))
    for key in ("title", "measure"):
        if not isinstance(given[key], str) or not given[key].strip():
            raise ShakeError(f"{where}: {key}: {shown(given[key])} is not a text")
    if not isinstance(given["rows"], list) or not given["rows"]:
        raise ShakeError(f"{where}: rows: is not a list of blocks")
    given["rows"] = [_checked_block(block, f"{where}: rows: {i + 1}") for i, block in enumerate(given["rows"])]
    given["same"] = _values(given.get("same") or {}, f"{where}: same")
    files = given.get("files") or []
    if not isinstance(files, list) or not all(isinstance(f, str) for f in files):
        raise ShakeError(f"{where}: files: is not a list of names")
    if given.get("order", "listed") not in ORDERS:
        raise unknown_name("order", given["order"], ORDERS, where)
    _change(given, changes, where)
    listed = given.get("report") or []
    if not isinstance(listed, list):
        raise ShakeError(f"{where}: report: is not a list of sections")
    sections = tuple(_section(part, f"{where}: report: {i + 1}") for i, part in enumerate(listed))
    study = Study(name, where, given, given["title"].strip(), given["measure"], tuple(files), sections)
    _check_rows(study)
    return study


def _checked_block(block: Any, where: str) -> dict[str, Any]:
    if isinstance(block, Mapping) and "list" in block:
        found = dict(strict_keys(block, LISTED, where, ("list",), kind="key"))
        if not isinstance(found["list"], str):
            raise ShakeError(f"{where}: list: {shown(found['list'])} is not module:function")
        return {"list": found["list"], "with": _values(found.get("with") or {}, f"{where}: with")}
    found = _values(block, where)
    for name, values in found.items():
        if isinstance(values, Mapping):
            strict_keys(values, RANGE, f"{where}: {name}", RANGE, kind="key")
            if not all(type(values[key]) is int for key in RANGE) or values["last"] < values["first"]:
                raise ShakeError(f"{where}: {name}: first and last are not rising whole numbers")
        elif not isinstance(values, list) or not values:
            raise ShakeError(f"{where}: {name}: {shown(values)} is neither a list of values nor first and last")
    return found


def _values(content: Any, where: str) -> dict[str, Any]:
    if not isinstance(content, Mapping) or not all(isinstance(name, str) for name in content):
        raise ShakeError(f"{where}: is not a mapping of names to values")
    try:
        canonical(content)
    except (TypeError, ValueError):
        raise ShakeError(f"{where}: holds a value that is neither number, text, true, false, null nor a list") from None
    return dict(content)


def _change(given: dict[str, Any], changes: Mapping[str, Any], where: str) -> None:
    """Put other values in the place of a study's own, wherever their names stand."""
    places = [given["same"], *(b["with"] if "list" in b else b for b in given["rows"])]
    for name, value in changes.items():
        found = [place for place in places if name in place]
        if not found:
            raise unknown_name("value", name, sorted({n for place in places for n in place}), where)
        for place in found:
            varied = place is not given["same"] and any(place is block for block in given["rows"])
            several = isinstance(value, list | Mapping)
            if several and not varied and not isinstance(place[name], type(value)):
                raise ShakeError(f"{where}: {name}: {shown(value)} is a list or range; every row has the same value")
            place[name] = [value] if varied and not several else value
    given["rows"] = [_checked_block(block, f"{where}: rows: {i + 1}") for i, block in enumerate(given["rows"])]


def _section(part: Any, where: str) -> StudySection:
    if not isinstance(part, Mapping) or len(kinds := [kind for kind in SECTIONS if kind in part]) != 1:
        raise ShakeError(f"{where}: is not a mapping with one of the keys {', '.join(SECTIONS)}")
    (kind,) = kinds
    given = strict_keys(part, ("title", kind, "by", "where", "of"), where, (kind,), kind="key")
    columns = given[kind]
    if kind in NAMED:
        columns = dict(strict_keys(columns, NAMED[kind], f"{where}: {kind}", NAMED[kind], kind="key"))
    elif isinstance(columns, list):
        columns = {str(name): str(name) for name in columns}
    if not isinstance(columns, Mapping) or not all(isinstance(c, str) for c in columns.values()):
        raise ShakeError(f"{where}: {kind}: is neither a list of columns nor a mapping of titles to columns")
    by, condition = given.get("by") or [], given.get("where") or {}
    if not isinstance(by, list) or not isinstance(condition, Mapping):
        raise ShakeError(f"{where}: by is not a list of columns, or where not a mapping of columns to values")
    title = str(given.get("title") or kind.capitalize())
    return StudySection(kind, title, dict(columns), tuple(map(str, by)), dict(condition), str(given.get("of") or ""))


def _check_rows(study: Study) -> None:
    """Look at the rows and their files, before anything is run."""
    call = _function(study.measure, f"{study.where}: measure")
    count = 0
    for count, row in enumerate(study.rows(), 1):
        _check_names(call, row, f"{study.where}: row {count}")
        if count > LARGEST:
            raise ShakeError(f"{study.where}: rows: more than {LARGEST}")
        for name in study.files:
            if name not in row:
                raise ShakeError(f"{study.where}: files: no row has a value '{name}'")
            if not _is_name(row[name]) and not Path(str(row[name])).exists():
                raise ShakeError(f"{study.where}: {name}: {row[name]} does not exist")
    if not count:
        raise ShakeError(f"{study.where}: rows: there are none")


def _product(block: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Every combination of a block's values; the last name varies fastest."""
    lists = [v if isinstance(v, Sequence) else range(v["first"], v["last"] + 1) for v in block.values()]
    for combination in itertools.product(*lists):
        yield dict(zip(block, combination, strict=True))


def _listed(block: Mapping[str, Any], where: str) -> Iterator[dict[str, Any]]:
    """The rows that a function lists."""
    call = _function(block["list"], f"{where}: list")
    _check_names(call, block["with"], f"{where}: with")
    for row in call(**block["with"]):
        yield _values(row, f"{where}: {block['list']}")


def _function(name: str, where: str) -> Callable[..., Any]:
    try:
        return function_of(name)
    except ShakeError as error:
        raise ShakeError(f"{where}: {error}") from None


def _check_names(call: Callable[..., Any], given: Mapping[str, Any], where: str) -> None:
    """Refuse names that a function does not take, and names that it needs and does not get."""
    try:
        inspect.signature(call).bind(**given)
    except TypeError as error:
        raise ShakeError(f"{where}: {error}") from None
