"""The description of a result: its text, tables and charts, said once, and read on a page or in a terminal.

`Page.render` makes one self-contained HTML page of it, to read and to zoom without a network; `Page.text` the lines of
a terminal. `write_page` puts the page into a result folder, with static copies of its charts where they are wanted.
`Result` is what a verb found, for whoever asks: numbers for programs, a page for a reader, its text for a terminal.
"""

from __future__ import annotations

import copy
import html
import itertools
import json
import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from shake_ros import __version__
from shake_ros.failures import RAISING, Failures
from shake_ros.report.chart import Chart, chart_json
from shake_ros.report.result_table import ResultTable, aligned
from shake_ros.report.text import sentence
from shake_ros.result_folder import new_folder, write_json

WEB = Path(__file__).resolve().parent / "web"
LARGEST = 5_500_000  # of a page's charts [byte]
MANY = 8  # columns from which on a table is printed small
NUMERIC = re.compile(r"[<>≈≤±−+-]?\s?[\d.]|not known|–$|$")
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
BUTTONS = (
    ("view", "start", "the segment shown at first"),
    ("whole", "all", "the whole abscissa (double click)"),
    ("in", "+", "zoom in (or drag over the chart)"),
    ("out", "−", "zoom out"),
    ("left", "◂", "earlier"),
    ("right", "▸", "later"),
    ("csv", "CSV", "download what is plotted, as a table"),
)


class Bar(NamedTuple):
    """A cell with a bar from zero; share : of the widest bar, 0 … 1."""

    share: float
    text: str


class Source(NamedTuple):
    """A recording that a page was made from. use : what for. seconds : length [s]. rate : of its samples [Hz]."""

    name: str
    use: str
    seconds: float
    samples: int
    rate: float


class Part(NamedTuple):
    """A part of a page. text : in a terminal, empty where it is for the page alone. level : 2 or 3 of a heading."""

    shown: str | Chart
    text: str = ""
    level: int = 0


class Page:
    """Collects sections, and renders them as a page or as text.

    Parameters
    ----------
    sources : recordings that it was made from.
    failures : takes those of its parts.
    """

    def __init__(self, title: str, lead: str, sources: Sequence[Source] = (), failures: Failures = RAISING) -> None:
        self._title, self._lead = title, lead
        self._sources, self._failures = sources, failures
        self._parts: list[Part] = []
        self._contents: list[tuple[str, str]] = []
        self._detail = 0  # level of the heading whose section is on the page alone

    @property
    def charts(self) -> list[Chart]:
        """The charts in their order, for static copies."""
        return [part.shown for part in self._parts if isinstance(part.shown, Chart)]

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """A part of the page; where it fails, a line stands in its place."""
        parts, contents, failed = len(self._parts), len(self._contents), len(self._failures)
        with self._failures.step(f"page, {name}"):
            yield
        for failure in self._failures.all[failed:]:
            del self._parts[parts:], self._contents[contents:]
            self.paragraph(sentence(str(failure)))

    def heading(self, text: str, detail: bool = False) -> None:
        """A section's heading, with its line in the contents; details are for the page alone."""
        name = f"s{len(self._contents) + 1}"
        self._contents.append((name, text))
        self._head(f"<h2 id='{name}'>{html.escape(text)}</h2>", text, 2, detail)

    def subheading(self, text: str, detail: bool = False) -> None:
        """A heading within a section."""
        self._head(f"<h3>{html.escape(text)}</h3>", text, 3, detail)

    def _head(self, shown: str, text: str, level: int, detail: bool) -> None:
        if not 0 < self._detail < level:
            self._detail = level if detail else 0
        self._add(shown, text, level)

    def _add(self, shown: str | Chart, text: str = "", level: int = 0) -> None:
        self._parts.append(Part(shown, "" if self._detail else text, level))

    def paragraph(self, text: str, note: bool = False) -> None:
        """A paragraph of plain text; a note is quieter, and for the page alone."""
        self._add(f"<p{' class=note' if note else ''}>{_kept(text)}</p>", "" if note else text)

    def hint(self, text: str) -> None:
        """A paragraph on how to use the page, which paper does not show."""
        self._add(f"<p class=hint>{_kept(text)}</p>")

    def link(self, text: str, file: str) -> None:
        """A paragraph that leads to another file of the same folder."""
        self._add(f"<p><a href='{html.escape(file)}'>{html.escape(text)}</a></p>")

    def cards(self, entries: Sequence[tuple[str, str]]) -> None:
        """A row of (value, meaning) cards."""
        cells = "".join(f"<div class='card'><b>{_breaking(v)}</b><span>{_breaking(m)}</span></div>" for v, m in entries)
        self._add(f"<div class='cards'>{cells}</div>", aligned(entries, (False, False)))

    def table(
        self,
        head: Sequence[str],
        rows: Sequence[Sequence[str | Bar]],
        best: int | None = None,
        warn: Collection[int] = (),
        start: int | None = None,
    ) -> None:
        """A table; row `best` is marked, rows `warn` want attention, `start` is what the others are compared with."""
        texts = [[cell.text if isinstance(cell, Bar) else cell for cell in row] for row in rows]
        left = [i == 0 or not all(NUMERIC.match(row[i]) for row in texts) for i in range(len(head))]
        top = "".join(
            f"<th{' class=text' if side else ''}>{html.escape(h)}</th>" for h, side in zip(head, left, strict=True)
        )
        body = []
        for i, row in enumerate(rows):
            kind = "best" if i == best else "warn" if i in warn else "start" if i == start else ""
            cells = "".join(_cell(cell, side) for cell, side in zip(row, left, strict=True))
            body.append(f"<tr{f' class={kind}' if kind else ''}>{cells}</tr>")
        many = " many" if len(head) > MANY else ""
        lines = [[cell.replace("\n", " ") for cell in row] for row in ([head] if any(head) else []) + texts]
        self._add(
            f"<div class='table'><table class='data{many}'><thead><tr>{top}</tr></thead>"
            f"<tbody>{''.join(body)}</tbody></table></div>",
            aligned(lines, [not side for side in left]),
        )

    def result(self, table: ResultTable, warn: Collection[int] = (), best: int | None = None) -> None:
        """A table of results as it is printed; row `best` is marked, rows `warn` want attention."""
        self.table(table.columns, table.cells(), warn=warn, best=best)

    def matrix(self, names: Sequence[str], values: np.ndarray) -> None:
        """A square of numbers from −1 to 1, coloured by size and sign; blank where not finite."""
        top = "".join(f"<th>{html.escape(name)}</th>" for name in names)
        rows = []
        for name, row in zip(names, values.tolist(), strict=True):
            cells = "".join(
                f"<td style='--tone:var(--{'after' if v < 0 else 'before'});--part:{85 * abs(v):.0f}%'>{v:.2f}</td>"
                if np.isfinite(v)
                else "<td></td>"
                for v in row
            )
            rows.append(f"<tr><th>{html.escape(name)}</th>{cells}</tr>")
        self._add(
            f"<div class='table'><table class='matrix'><thead><tr><th></th>{top}</tr></thead>"
            f"<tbody>{''.join(rows)}</tbody></table></div>".replace("-0.00", "0.00").replace(">-", ">−")
        )

    def chart(self, chart: Chart) -> None:
        """A chart with its caption; its name becomes one of its own that a file may have."""
        name = re.sub(r"[^\w.-]+", "_", chart.name)
        taken = {other.name for other in self.charts}
        again = (f"{name}_{k}" for k in itertools.count(2))
        while name in taken:
            name = next(again)
        self._add(replace(chart, name=name))

    def text(self) -> str:
        """The same for a terminal: without charts, notes and details."""
        lines = [self._title, self._lead]
        for part in self._brief():
            apart = part.level or ("\n" in lines[-1].strip() and "\n" in part.text)  # two tables
            lines.append(f"\n{part.text}" if apart else part.text)
        return "\n".join(lines)

    def brief(self) -> str:
        """The same for a notebook, as HTML."""
        return "".join(str(part.shown) for part in self._brief())

    def _brief(self) -> list[Part]:
        """The parts that have a text, but for headings with nothing below them."""
        found, below = list[Part](), 2
        for part in reversed([part for part in self._parts if part.text]):
            if not part.level or not 0 < below <= part.level:
                found.append(part)
                below = part.level
        return found[::-1]

    def render(self, now: datetime | None = None, command: str = "") -> str:
        """The whole page.

        Parameters
        ----------
        now : the date on it, the clock's where not given. command : line that made it, empty from Python.
        """
        date = (now or datetime.now(timezone.utc)).strftime("%Y-%m-%d %H:%M UTC")
        whole = copy.copy(self)
        whole._parts, whole._contents = [*self._parts], [*self._contents]
        whole._made_section(date, command)
        contents = "".join(f"<li><a href='#{name}'>{html.escape(text)}</a></li>" for name, text in whole._contents)
        title, sources = html.escape(self._title), self._sources
        total = sum(s.seconds for s in sources)
        from_what = f" · {len(sources)} recording{'s' * (len(sources) > 1)}, {total:.1f} s" if sources else ""
        return (
            "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
            "<meta name='viewport' content='width=device-width, initial-scale=1'>"
            f"<title>{title}</title><style>{_web('uPlot.min.css')}{_web('page.css')}</style></head><body>"
            f"<nav><details open><summary>Contents</summary><ol>{contents}</ol></details>"
            "<button id='theme' type='button'>light / dark</button></nav>"
            f"<main><h1>{title}</h1><p class='lead'>{html.escape(self._lead)}</p>"
            f"<p class='made'>{date} · shake_ros {__version__}{from_what}</p>"
            "<noscript><p>The charts need JavaScript, which this browser has switched off; text and tables work "
            "without.</p></noscript>"
            + "\n".join(whole._drawn())
            + f"</main><script>{_web('uPlot.iife.min.js')}</script><script>{_web('charts.js')}</script></body></html>\n"
        )

    def _made_section(self, date: str, command: str) -> None:
        self.heading("Where this comes from", detail=True)
        line = f"<code>{html.escape(command)}</code>" if command else "from Python"
        self._add(f"<p>Made {date} by shake_ros {__version__}: {line}</p>")
        if self._sources:
            rows = [[s.name, s.use, f"{s.seconds:.2f} s", f"{s.samples}", f"{s.rate:.6g} Hz"] for s in self._sources]
            self.table(("recording", "used for", "length", "samples", "rate"), rows)

    def _drawn(self) -> list[str]:
        """The parts as HTML, the charts thinned until the page is small enough."""
        block = 1
        while True:
            charts = [chart if block == 1 else chart.thinned(block) for chart in self.charts]
            parts = [_chart(chart) for chart in charts]
            if sum(map(len, parts)) <= LARGEST or block > 1024:
                break
            block = 2 * block if block > 1 else 4
        left = iter(parts)
        return [next(left) if isinstance(part.shown, Chart) else part.shown for part in self._parts]


def _web(name: str) -> str:
    return (WEB / name).read_text(encoding="utf-8")


def _kept(text: str) -> str:
    """Text whose numbers keep their per cent."""
    return html.escape(text).replace(" %", "\u00a0%")


def _breaking(text: str) -> str:
    """Text that may break behind an underscore of a name, and not between a number and its unit."""
    return _kept(text).replace("_", "_<wbr>").replace(" m/s²", "\u00a0m/s²")


def _cell(cell: str | Bar, left: bool) -> str:
    if isinstance(cell, Bar):
        return f"<td class='bar'><i style='width:{7.0 * min(cell.share, 1.0):.2f}rem'></i>{html.escape(cell.text)}</td>"
    return f"<td{' class=text' if left else ''}>{_kept(cell)}</td>"


def _chart(chart: Chart) -> str:
    content: Any = json.dumps(chart_json(chart), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    buttons = "".join(
        f"<button type='button' data-do='{what}' title='{tip}'>{text}</button>" for what, text, tip in BUTTONS
    )
    return (
        f"<figure class='chart' id='chart-{html.escape(chart.name)}'><div class='plots'></div>"
        f"<figcaption><span>{html.escape(chart.caption)}</span>{buttons}</figcaption>"
        f"<script type='application/json'>{content}</script></figure>"
    )


def write_page(page: Page, folder: Path, figures: str | None = None, name: str = "report", command: str = "") -> None:
    """Write `name`.html; with `figures` (pdf, svg or png) the charts into the folder `name`_figures as well."""
    (folder / f"{name}.html").write_text(page.render(command=command), encoding="utf-8")
    if figures:
        from shake_ros.report.chart import save_figures  # brings matplotlib, which is slow to load

        save_figures(page.charts, folder / f"{name}_figures", figures)


class Result(ABC):
    """A result that is described once, by `page`, and printed as the text of that."""

    # numbers, page_name: of the files of `content` and of the page
    numbers: ClassVar[str] = "report.json"
    page_name: ClassVar[str] = "report"

    @abstractmethod
    def content(self) -> Any:
        """All figures, for JSON."""

    @property
    @abstractmethod
    def page(self) -> Page:
        """What was found, in words, tables and charts."""

    def files(self, work: Path, folder: Path, /) -> None:  # noqa: B027 (some have none)
        """Write what stands beside page and numbers into `work`, which becomes `folder`."""

    def report(self, folder: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> Path:
        """Write the page, its numbers as JSON, and what a program goes on with.

        Parameters
        ----------
        folder : of the result.
        force : replace an existing one.
        figures : adds static copies of the charts, as "pdf", "svg" or "png".
        command : line that the page names as its origin.

        Raises
        ------
        ShakeError : the folder is there and `force` is not given.
        """
        with new_folder(Path(folder), force=force) as work:
            write_json(work / self.numbers, self.content())
            write_page(self.page, work, figures, self.page_name, command)
            self.files(work, Path(folder))
        return Path(folder)

    def __repr__(self) -> str:
        return self.page.text()

    def _repr_html_(self) -> str:
        return self.page.brief()
