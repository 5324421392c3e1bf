"""The tables of a comparison as rows of text, for a terminal and for the page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shake_ros.core.loop.metrics import Outcome, Summary, by_load
from shake_ros.report.text import percent

HEAD = (
    "controller", "J1 [ms]", "position", "worst", "velocity", "worst", "acceleration", "worst", "spectrum", "THD",
    "travel [1/s]", "at limit", "perturbed", "unstable", "end stop",
)  # fmt: skip


def number(value: float, digits: int = 2) -> str:
    """A number, a dash where there is none."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"


def summary_rows(summaries: Sequence[Summary]) -> list[list[str]]:
    """One row per controller under HEAD: mean and worst over references and loads, worst over the perturbed tables."""
    rows = []
    for s in summaries:
        m, w = s.mean, s.worst
        rows.append(
            [s.entry, number(1e3 * m.delay)]
            + [
                percent(value)
                for name in ("position_error", "velocity_error", "acceleration_error")
                for value in (getattr(m, name), getattr(w, name))
            ]
            + [percent(m.spectrum_error), percent(m.thd), number(m.command_travel), percent(m.time_at_limit)]
            + [percent(s.perturbed_worst.position_error), str(s.unstable), str(s.end_stops)]
        )
    return rows


def load_rows(outcomes: Sequence[Outcome]) -> tuple[list[str], list[list[str]]]:
    """Head and rows: mean position error and command travel of each controller by load."""
    loads = sorted({o.load for o in outcomes if o.table < 0})
    head = ["controller"] + [f"position, {load:g} kg" for load in loads] + [f"travel, {load:g} kg" for load in loads]
    rows = []
    for entry in dict.fromkeys(o.entry for o in outcomes):
        errors, travels = (by_load(outcomes, entry, name) for name in ("position_error", "command_travel"))
        rows.append([entry, *(percent(errors[x]) for x in loads), *(number(travels[x]) for x in loads)])
    return head, rows


def trouble(outcomes: Sequence[Outcome]) -> list[str]:
    """A line for each run that was unstable or touched an end stop."""
    lines = []
    for o in outcomes:
        what = [text for text, flag in (("unstable", o.metrics.unstable), ("end stop", o.metrics.end_stop)) if flag]
        if what:
            table = f"perturbed table {o.table}" if o.table >= 0 else "declared table"
            lines.append(f"{o.entry}: {o.reference}, {o.load:g} kg, {table}: {' and '.join(what)}")
    return lines


def aligned(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of text, the first column to the left."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    lines = []
    for row in [head, *rows]:
        cells = [f"{row[0]:<{widths[0]}}"] + [f"{c:>{w}}" for c, w in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
