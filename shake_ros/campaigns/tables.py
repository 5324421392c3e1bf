"""The tables of a campaign, from its rows: shares with intervals, confusion, spread, changes, against an older one."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2, norm, t

from shake_ros.campaigns.rows import FinishedRow
from shake_ros.campaigns.study import StudySection, canonical

NORMAL_95 = 1.959963984540054  # two-sided quantile of the normal distribution


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
        z, n, p = NORMAL_95, self.of, self.value
        centre = p + z * z / (2 * n)
        width = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        scale = 1 + z * z / n
        return max((centre - width) / scale, 0.0), min((centre + width) / scale, 1.0)

    def __str__(self) -> str:
        """
        >>> print(Share(9, 10))
        90.0 % of 10 (59.6 … 98.2 %)
        """
        if self.of == 0:
            return "no case"
        low, high = self.interval
        return f"{100 * self.value:.1f} % of {self.of} ({100 * low:.1f} … {100 * high:.1f} %)"


FALSE_ALARM = 0.01  # over all parameters and places of one thing
LEAST = 2  # readings without which nothing can be decided
SCATTER = 0.02  # of a parameter from reading to reading that no standard error counts, relative to its size


@dataclass(frozen=True)
class Reading:
    """Parameters at a time. values : parameter → value and standard error; None where it has none."""

    when: str
    values: Mapping[str, tuple[float, float | None]]


@dataclass(frozen=True)
class StepChange:
    """A parameter that stepped. when : first reading behind the step. before, after : weighted means.

    score : the step over its standard deviation [-]. chance : of such a score where nothing changed [-].
    """

    parameter: str
    when: str
    before: float
    after: float
    score: float
    chance: float


def step_changes(readings: Sequence[Reading]) -> list[StepChange]:
    """The steps that stand out, the surest first; each thing's readings are taken to have one at most per parameter.

    The mean of the readings before a place is compared with that behind it, each reading weighted by its variance: the
    square of its standard error, or of the scatter of the readings within both sides where that is larger (then the
    score is Student's, of as many degrees of freedom). Bonferroni's bound over all parameters and places keeps false
    alarms of a thing below FALSE_ALARM. Parameters that a fit trades for one another may step together; the surest is
    the first.

    >>> flat, step = [(1.0, 0.01)] * 4, [(5.0, 0.1), (5.1, 0.1), (9.0, 0.1), (9.1, 0.1)]
    >>> readings = [Reading(f"day {k}", {"a": flat[k], "b": step[k]}) for k in range(4)]
    >>> [(s.parameter, s.when, round(s.before, 2), round(s.after, 2)) for s in step_changes(readings)]
    [('b', 'day 2', 5.05, 9.05)]
    """
    names = sorted({name for reading in readings for name in reading.values})
    places = max(len(readings) - 1, 1) * max(len(names), 1)
    steps = [step for name in names if (step := _largest(name, readings)) is not None]
    return sorted((s for s in steps if s.chance < FALSE_ALARM / places), key=lambda step: step.chance)


def _largest(name: str, readings: Sequence[Reading]) -> StepChange | None:
    """The surest step of a parameter."""
    listed = [(r.when, *r.values[name]) for r in readings if name in r.values]
    known = [(when, value, error) for when, value, error in listed if error is not None and math.isfinite(value)]
    if len(known) < LEAST:
        return None
    values, errors = np.array([v for _, v, _ in known]), np.array([e for _, _, e in known])
    steps = []
    for at in range(1, len(known)):
        left = len(known) - 2
        sides = values[:at], values[at:]
        within = sum(float(np.sum((side - side.mean()) ** 2)) for side in sides)
        seen, assumed = within / left if left else 0.0, (SCATTER * float(np.mean(np.abs(values)))) ** 2
        weight = 1.0 / np.maximum(errors**2, max(seen, assumed))
        before, after = (np.average(values[part], weights=weight[part]) for part in (slice(at), slice(at, None)))
        deviation = math.sqrt(1.0 / weight[:at].sum() + 1.0 / weight[at:].sum())
        score = abs(after - before) / deviation if deviation else 0.0
        scattered = seen > max(assumed, float(np.median(errors**2)))
        chance = 2.0 * float(t.sf(score, left) if scattered else norm.sf(score))
        steps.append(StepChange(name, known[at][0], float(before), float(after), float(score), chance))
    return min(steps, key=lambda step: step.chance)


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
    answers = [bool(v) for row in rows if (v := row.value(column)) is not None]
    return Share(sum(answers), len(answers))


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


def _rate(section: StudySection, rows: Sequence[FinishedRow]) -> Table:
    events, over = section.columns["events"], section.columns["over"]
    cells = []
    for values, some in groups(section, rows):
        rate = Rate(round(float(np.sum(numbers(some, events)))), float(np.sum(numbers(some, over))))
        known = [f"{100.0 * r:.3g}" for r in (rate.events / rate.over, *rate.interval)] if rate.over else [NOTHING] * 3
        cells.append([*map(shown, values), str(rate.events), f"{rate.over:.4g}", *known])
    return [*section.by, events, over, "in 100", "at least", "at most"], cells


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


def _named(parameter: str, description: Mapping[str, Any]) -> str:
    return f"{parameter} [{description['unit']}]" if description.get("unit") else parameter


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
    "rate": _rate,
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
