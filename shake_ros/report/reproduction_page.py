"""The pages of `reproduce`: one for each experiment, and the table of all claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shake_ros.report.experiment import Claim, ExperimentReport
from shake_ros.report.page import Made, Page

INDEX = "index.html"
HEAD = ("section", "the thesis says", "printed", "here", "verdict")


def claim_rows(claims: Sequence[Claim]) -> list[list[str]]:
    """A row for each claim."""
    return [[c.source, c.statement, c.printed, c.found, c.verdict] for c in claims]


def experiment_page(experiment: ExperimentReport, command: str = "") -> Page:
    """The page of one experiment."""
    page = Page(experiment.title, experiment.lead, Made(command))
    page.link("all claims of the chapter", INDEX)
    page.heading("What the thesis says")
    page.table(HEAD, claim_rows(experiment.claims))
    for claim in experiment.claims:
        if claim.remark:
            page.paragraph(f"{claim.statement}: {claim.remark}")
    if experiment.remarks:
        page.heading("Assumptions and remarks")
    for remark in experiment.remarks:
        page.paragraph(remark)
    for title, head, rows in experiment.tables:
        page.heading(title)
        page.table(head, rows)
    if experiment.charts:
        page.heading("Figures")
    for chart in experiment.charts:
        page.chart(chart)
    return page


def index_page(
    experiments: Mapping[str, ExperimentReport], command: str = "", figures: Mapping[str, str] | None = None
) -> Page:
    """The page of all claims, by experiment, and of the figures of the chapter with what draws them or why not."""
    page = Page("Chapter 6 of the thesis, run again", count_of(experiments), Made(command))
    for name, experiment in experiments.items():
        page.heading(experiment.title)
        page.link("its tables, figures and remarks", f"{name}.html")
        page.table(HEAD, claim_rows(experiment.claims))
    if figures:
        page.heading("Figures of the chapter")
        page.table(("figure", "drawn by, or why not"), [list(row) for row in figures.items()])
    return page


def count_of(experiments: Mapping[str, ExperimentReport]) -> str:
    """How many claims hold, in a sentence."""
    verdicts = [c.holds for e in experiments.values() for c in e.claims]
    counts = [verdicts.count(v) for v in (True, False, None)]
    return f"{len(verdicts)} claims: {counts[0]} hold, {counts[1]} do not, {counts[2]} cannot be told."


def _left(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of text, every column to the left."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in [head, *rows])


def tables_text(experiments: Mapping[str, ExperimentReport]) -> str:
    """All tables, aligned for a terminal."""
    parts = [
        f"{title} ({name})\n{_left(head, [list(map(str, row)) for row in rows])}\n"
        for name, experiment in experiments.items()
        for title, head, rows in experiment.tables
    ]
    return "\n".join(parts)


def claims_text(experiments: Mapping[str, ExperimentReport]) -> str:
    """All claims, aligned for a terminal."""
    parts = [count_of(experiments)]
    for name, experiment in experiments.items():
        parts += ["", f"{experiment.title} ({name})", _left(HEAD, claim_rows(experiment.claims))]
    return "\n".join(parts)
