"""The tables of a campaign, from its rows: shares with intervals, confusion, spread, changes, against an older one."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shake_ros.core.analysis.proportion import Share
from shake_ros.core.analysis.step_change import Reading, StepChange, step_changes
from shake_ros.data.campaign_file import FinishedRow
from shake_ros.data.study import StudySection, canonical

Cells = list[list[str]]
Table = tuple[list[str], Cells]
NOTHING = "–"


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
    return value if value is None or isinstance(value, str | int | float | bool) else shown(value)


def shown(value: Any) -> str:
    """A value as a cell.

    >>> shown(0.1), shown(None), shown(["soft_zone", "dead_volume"]), shown([])
    ('0.1', '–', 'soft_zone, dead_volume', 'nothing')
    """
    if value is None:
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(map(shown, value)) or "nothing"
    return str(value)


def share(rows: Sequence[FinishedRow], column: str) -> Share:
    """Of the rows where a column says so or not, how many say so."""
    told = [bool(v) for row in rows if (v := row.value(column)) is not None]
    return Share(sum(told), len(told))


def numbers(rows: Sequence[FinishedRow], column: str) -> np.ndarray:
    """The finite numbers of a column, sorted, shape (n,)."""
    values = [row.value(column) for row in rows]
    return np.sort([float(v) for v in values if isinstance(v, int | float) and math.isfinite(v)])


def section_table(section: StudySection, rows: Sequence[FinishedRow]) -> Table:
    """Head and cells of a section."""
    return _TABLES[section.kind](section, rows)


def _shares(section: StudySection, rows: Sequence[FinishedRow]) -> Table:
    cells = [
        [*map(shown, values), *(str(share(some, column)) for column in section.columns.values())]
        for values, some in groups(section, rows)
    ]
    return [*section.by, *section.columns], cells


def _matrix(section: StudySection, rows: Sequence[FinishedRow]) -> Table:
    truth, named = section.columns["truth"], section.columns["named"]
    counts: dict[tuple[str, ...], Counter[str]] = {}
    for values, some in groups(replace(section, by=(truth, *section.by)), rows):
        counts[tuple(map(shown, values))] = Counter(shown(row.value(named)) for row in some)
    names = sorted({name for counter in counts.values() for name in counter})
    order = [n for n in dict.fromkeys(v[0] for v in counts) if n in names]
    order += [n for n in names if n not in order]
    cells = [[*values, *(str(counter[n] or "") for n in order)] for values, counter in counts.items()]
    return [truth, *section.by, *order], cells


def _spread(section: StudySection, rows: Sequence[FinishedRow]) -> Table:
    cells = []
    for values, some in groups(section, rows):
        for title, column in section.columns.items():
            found = numbers(some, column)
            low, middle, high = np.quantile(found, [0.25, 0.5, 0.75]) if len(found) else [math.nan] * 3
            largest = found[-1] if len(found) else math.nan
            numbers_shown = [f"{v:.4g}" if math.isfinite(v) else NOTHING for v in (middle, low, high, largest)]
            cells.append([*map(shown, values), title, str(len(found)), *numbers_shown])
    return [*section.by, "figure", "rows", "median", "lower quartile", "upper quartile", "largest"], cells


def changes_of(section: StudySection, rows: Sequence[FinishedRow]) -> list[tuple[str, list[StepChange]]]:
    """For each thing of an archive the steps of its parameters; empty where none changed."""
    of, when, column = (section.columns[name] for name in ("of", "when", "parameters"))
    found = []
    for (name,), some in groups(replace(section, by=(of,)), rows):
        readings = [
            Reading(
                str(row.value(when)), {_named(p, v): (v["value"], v["std_error"]) for p, v in row.value(column).items()}
            )
            for row in sorted(some, key=lambda row: str(row.value(when)))
        ]
        found.append((str(name), step_changes(readings)))
    return found


def _named(parameter: str, told: Mapping[str, Any]) -> str:
    return f"{parameter} [{told['unit']}]" if told.get("unit") else parameter


def _changes(section: StudySection, rows: Sequence[FinishedRow]) -> Table:
    cells = []
    for name, steps in changes_of(section, rows):
        for s in steps:
            sure = f"{s.score:.1f}"
            cells.append([name, s.when, s.parameter, f"{s.before:.4g}", f"{s.after:.4g}", _relative(s), sure])
        if not steps:
            cells.append([name, NOTHING, "nothing changed", NOTHING, NOTHING, NOTHING, NOTHING])
    return [section.columns["of"], "since", "parameter", "before", "after", "change", "times its deviation"], cells


def _relative(step: StepChange) -> str:
    return f"{100.0 * (step.after / step.before - 1.0):+.1f} %".replace("-", "−") if step.before else NOTHING


_TABLES: dict[str, Callable[[StudySection, Sequence[FinishedRow]], Table]] = {
    "shares": _shares,
    "matrix": _matrix,
    "spread": _spread,
    "changes": _changes,
}


def against(rows: Sequence[FinishedRow], other: Sequence[FinishedRow], sections: Sequence[StudySection]) -> Table:
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
                texts = [str(share(some, column)) for some in pair]
            else:
                texts = [
                    f"median {np.median(n):.4g} of {len(n)}" if len(n := numbers(s, column)) else NOTHING for s in pair
                ]
            cells.append([section.title, ", ".join(map(shown, values)), title, *texts])
    return ["section", "group", "figure", "here", "older"], cells


def in_both(rows: Sequence[FinishedRow], other: Sequence[FinishedRow]) -> tuple[list[FinishedRow], list[FinishedRow]]:
    """The rows whose values both have, in one order."""
    older = {canonical(row.given): row for row in other}
    pairs = [(row, older[text]) for row in rows if (text := canonical(row.given)) in older]
    return [a for a, _ in pairs], [b for _, b in pairs]
