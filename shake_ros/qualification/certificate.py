"""The certificate of a qualification: an HTML page, and a PDF on A4 with the same tables."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from shake_ros.iteration.iterate import error_chart
from shake_ros.report.chart import AFTER, BEFORE, GREY, Chart, ChartSeries, Panel, draw
from shake_ros.report.page import Page

if TYPE_CHECKING:
    from shake_ros.qualification.result import Qualification

Array = NDArray[np.float64]
BAND = 0.9, 1.3  # of the RRS, drawn as the tolerance band


def motions(found: Qualification) -> dict[str, Array]:
    """Measured acceleration of the last run, and its velocity and displacement above its drift, by label."""
    motion, drift = found.runs[-1].motion, _drift(found)
    f = np.fft.rfftfreq(motion.size, found.sample_time)
    slope = np.where(f >= drift, 1.0 / (2j * np.pi * np.maximum(f, drift)), 0.0)
    spectrum = np.fft.rfft(motion)
    velocity, displacement = (np.fft.irfft(spectrum * slope**order, motion.size) for order in (1, 2))
    return {
        "acceleration [m/s²]": motion,
        "velocity [m/s]": velocity,
        "displacement [mm]": 1e3 * displacement,
    }


A4 = 8.27, 11.69  # [inch]
TEXT_CELLS = "table.data td { white-space: normal; overflow-wrap: anywhere }"
# of a sequence: dates whole, and words to the left that begin with a number
SEQUENCE_CELLS = f"""{TEXT_CELLS}
table.data.many td:nth-child(4) {{ white-space: nowrap }}
table.data:not(.many) :is(td, th) {{ text-align: left }}"""
MARGIN, LINE = 0.09, 0.0145  # of the page


def certificate_pages(found: Qualification, sums: Mapping[str, str], folder: Path) -> None:
    """Write certificate.html and certificate.pdf; sums : of the recordings' files."""
    page = certificate_page(found)
    page.heading("Recordings")
    page.table(("file", "SHA-256"), list(sums.items()))
    page.paragraph("./shake qualify --from THIS_FOLDER checks these sums and the recordings again.")
    content = page.render().replace("</style>", f"{TEXT_CELLS}</style>", 1)
    (folder / "certificate.html").write_text(content, encoding="utf-8")
    with PdfPages(folder / "certificate.pdf", metadata={"Title": _title(found), "CreationDate": None}) as pdf:
        figures = [_first(found), _spectra(found), _motion(found), *_files(sums)]
        for number, figure in enumerate(figures, start=1):
            foot = f"{found.required.name} · {found.about['date']} · page {number} of {len(figures)}"
            figure.text(0.5, 0.03, foot, ha="center", fontsize=7, color="#566474")
            pdf.savefig(figure)


def _title(found: Qualification) -> str:
    return f"Seismic qualification test: {'passed' if found.passed else 'not passed'}"


def _facts(found: Qualification) -> list[tuple[str, str]]:
    """What was tested, where, with what, against what."""
    required, rules, reason = found.required, found.rules, found.reason or found.moved
    return [
        *((key.capitalize(), text) for key, text in found.about.items()),
        ("Required spectrum", f"{required.name}, {100.0 * required.damping:g} % damping"),
        ("Its source", required.source),
        ("Rules", rules.name),
        ("Their source", rules.source),
        ("Measured acceleration", f"low-passed at {rules.low_pass:g} Hz without phase shift, mean at rest removed"),
        *([("Not passed because", reason)] if reason else []),
    ]


def _resonances(found: Qualification) -> list[tuple[str, str, str, str, str]]:
    """Every resonance of every search."""
    rows = []
    for when, search in (("before", found.before), ("after", found.after)):
        if search is None:
            continue
        name, coherence = f"{when} the test", f"{search.coherence:.2f}"
        rows += [
            (name, f"{r.frequency:.2f} Hz", f"{100.0 * r.damping:.1f} %", f"{r.mass:.0f} kg", coherence)
            for r in search.resonances
        ]
        if not search.resonances:
            rows.append((name, str(search), "–", "–", coherence))
    return rows


def _shifts(found: Qualification) -> list[tuple[str, str, str, str]]:
    """What became of each resonance."""
    rows = []
    for shift in found.shifts:
        before, after = (f"{r.frequency:.2f} Hz" if r else "–" for r in (shift.before, shift.after))
        frequency, damping = f"{100.0 * shift.frequency:+.1f} %", f"{100.0 * shift.damping:+.1f} %"
        if not (shift.before and shift.after):
            frequency, damping = "gone" if shift.before else "new", "–"
        rows.append((before, after, frequency, damping))
    return rows


def _drift(found: Qualification) -> float:
    """Below which a measured motion is drift [Hz]."""
    return 0.4 * float(found.required.frequencies[0])


RESONANCES = ("resonance search", "frequency", "damping", "moving mass", "coherence")
SHIFTS = ("resonance before", "after", "frequency moved", "damping moved")


def charts(found: Qualification) -> tuple[Chart, Chart, Chart]:
    """Spectra, motion, and the error of the spectrum run by run."""
    last = found.assessment
    f, required = last.frequencies, last.required
    band = [ChartSeries(f"{share:g} RRS", share * required, "grey", kind="dashed") for share in BAND]
    curves = (
        *band,
        ChartSeries("required, RRS", required, "before", width=2.4),
        ChartSeries("test, TRS", last.found, "c0", width=1.8),
    )
    spectra = Panel("absolute acceleration [m/s²]", f, curves, log=True, height=320, band=(1, 0))
    grid = "Required and test response spectrum of the last run on the code's own grid"
    panels = tuple(
        Panel(label, np.arange(len(values)) * found.sample_time, (ChartSeries(label, values, "c0"),))
        for label, values in motions(found).items()
    )
    errors = [run.error for run in found.runs]
    caption = "Measured acceleration of the last run; velocity and displacement from it, high-passed at "
    return (
        Chart("spectra", "frequency [Hz]", (spectra,), grid, log_x=True),
        Chart("motion", "time [s]", panels, f"{caption}{_drift(found):.2g} Hz"),
        error_chart([str(k + 1) for k in range(len(errors))], [("spectrum missed, rms of ln", errors, "c0")]),
    )


def certificate_page(found: Qualification) -> Page:
    """What was tested, rule by rule and run by run."""
    spectra, history, errors = charts(found)
    page = Page(_title(found), f"{found.required.name}, assessed by {found.rules.name}")
    page.heading("What was tested")
    page.table(("", ""), _facts(found))
    page.heading("Rules")
    page.result(found.verdicts)
    page.heading("Required and test response spectrum")
    page.chart(spectra)
    page.heading("Motion")
    page.chart(history)
    page.heading("Runs")
    page.result(found.error)
    if len(found.runs) > 1:
        page.chart(errors)
    if _resonances(found):
        page.heading("Resonance searches")
        page.table(RESONANCES, _resonances(found))
        if _shifts(found):
            page.table(SHIFTS, _shifts(found))
        search = found.about.get("search", "a low motion")
        page.paragraph(f"From the force of the cylinder over the table's acceleration under {search}.")
    return page


def sequence_page(content: Mapping[str, Any]) -> str:
    """sequence.html: the tests of a sequence in turn, and what became of the resonances."""
    end = "passed" if content["passed"] else "not passed" if content["reason"] else "not ended"
    page = Page(f"Sequence of qualification tests: {end}", content["name"])
    page.table(
        ("", ""),
        [
            ("Source", content["source"]),
            ("Ended because", content["reason"] or "–"),
            ("Waits for", content["waiting"] or "–"),
        ],
    )
    page.heading("Tests")
    rows = [
        (
            t["test"],
            f"{100.0 * t['share']:g} %",
            t["released_by"],
            t["date"].replace("T", " ").replace("+00:00", " UTC"),
            str(t["runs"]),
            f"{t['lowest']:.3f}",
            f"{t['largest']:.3f}",
            t["interlock"] or "clear",
            "passed" if t["passed"] else "not passed",
        )
        for t in content["tests"]
    ]
    ratios = ("lowest TRS/RRS", "largest TRS/RRS")
    page.table(("test", "of the RRS", "released by", "at", "runs", *ratios, "interlock", ""), rows)
    page.heading("Resonances")
    searched = [("before the first test", content["resonance_before"] or "–", "")]
    searched += [
        (f"after {t['test']}", t["resonance"], "; ".join(t["shifts"])) for t in content["tests"] if t["resonance"]
    ]
    page.table(("search", "found", "since the first"), searched)
    page.paragraph("Each test has its own certificate and recordings in the folder of its name.")
    return page.render().replace("</style>", f"{SEQUENCE_CELLS}</style>", 1)


def _sheet(title: str) -> Figure:
    figure = Figure(figsize=A4, layout="constrained")
    figure.text(MARGIN, 0.945, title, fontsize=13, weight="bold")
    return figure


def _draw(chart: Chart, figure: Figure, top: float, bottom: float) -> None:
    """A chart between two heights of a sheet."""
    rows = figure.add_gridspec(3, 3, height_ratios=(1.0 - top, top - bottom, bottom), width_ratios=(0.06, 0.88, 0.06))
    draw(chart, figure.add_subfigure(rows[1, 1]))


def _rows(
    figure: Figure,
    top: float,
    rows: Sequence[Sequence[str]],
    widths: Sequence[int],
    size: float = 7.5,
    head: bool = True,
) -> float:
    """Rows of wrapped text from `top` down; widths in characters, a bold `head` first. Returns where they end."""
    whole = sum(widths)
    starts = [MARGIN + (1.0 - 2.0 * MARGIN) * sum(widths[:k]) / whole for k in range(len(widths))]
    for number, row in enumerate(rows):
        cells = [textwrap.wrap(str(text), width) or [""] for text, width in zip(row, widths, strict=True)]
        for x, lines in zip(starts, cells, strict=True):
            word = lines[0] if len(lines) == 1 else ""
            colour = {"pass": AFTER, "FAIL": BEFORE}.get(word, "#1d2733")
            weight = "bold" if (number == 0 and head) or word == "FAIL" else "normal"
            figure.text(
                x, top, "\n".join(lines), fontsize=size, va="top", color=colour, weight=weight, linespacing=1.25
            )
        top -= LINE * max(map(len, cells)) + 0.006
        figure.add_artist(Line2D([MARGIN, 1.0 - MARGIN], [top + 0.004] * 2, color=GREY, linewidth=0.4))
    return top - 0.015


def _first(found: Qualification) -> Figure:
    figure = _sheet(_title(found))
    top = _rows(figure, 0.92, _facts(found), (24, 86), head=False)
    figure.text(MARGIN, top, "Rules", fontsize=11, weight="bold", va="top")
    _rows(figure, top - 0.025, [found.verdicts.columns, *found.verdicts.cells()], (50, 28, 34, 8))
    for x, who in ((MARGIN, "Tested by"), (0.52, "Witnessed by")):
        figure.text(x, 0.075, f"{who}:  ______________________________", fontsize=8)
    return figure


def _spectra(found: Qualification) -> Figure:
    spectra, _, errors = charts(found)
    figure = _sheet("Required and test response spectrum")
    _draw(spectra, figure, 0.92, 0.52)
    top = _rows(figure, 0.49, [found.error.columns, *found.error.cells()], (8, 24, 24, 24, 20))
    if _resonances(found):
        top = _rows(figure, top, [RESONANCES, *_resonances(found)], (26, 20, 18, 20, 16))
        if _shifts(found):
            top = _rows(figure, top, [SHIFTS, *_shifts(found)], (26, 20, 26, 28))
    if len(found.runs) > 1:
        _draw(errors, figure, min(top, 0.28), 0.06)
    return figure


def _motion(found: Qualification) -> Figure:
    figure = _sheet("Motion of the last run")
    _draw(charts(found)[1], figure, 0.92, 0.06)
    return figure


def _files(sums: Mapping[str, str]) -> list[Figure]:
    """The recordings with their sums, as many pages as they need."""
    rows, pages = list(sums.items()), []
    for first in range(0, len(rows), 34):
        figure = _sheet("Recordings")
        _rows(figure, 0.92, [("file", "SHA-256"), *rows[first : first + 34]], (40, 68), 7.0)
        pages.append(figure)
    return pages
