"""The pages: self-contained, complete, with figures that are drawn from the results."""

from __future__ import annotations

import base64
import dataclasses
import html.parser
import re

import numpy as np
import pytest
from closed_loops import command, named
from hidden_table import SAMPLE_TIME
from matplotlib.figure import Figure

from shake_ros.core.identification.recordings import Record
from shake_ros.core.identification.uncertainty import Estimate
from shake_ros.report import figures_fit, text
from shake_ros.report.close_loop_page import close_loop_page
from shake_ros.report.page import Page
from shake_ros.report.sections import parameter_table
from shake_ros.report.style import png

PNG = b"\x89PNG\r\n\x1a\n"


class Reader(html.parser.HTMLParser):
    """Collects links, sources, headings and unclosed tags of a page."""

    VOID = frozenset({"meta", "img", "br", "link", "hr", "input"})

    def __init__(self, page: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.words = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.links += [value or "" for name, value in attributes if name in ("src", "href", "srcset", "data")]
        assert tag not in ("script", "link", "iframe")
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data + " "
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1].append(data)


def check_self_contained(page: str) -> Reader:
    """No address but pictures inside the page, and every tag closed."""
    reader = Reader(page)
    assert reader.open == []
    assert "http://" not in page and "https://" not in page
    assert "@import" not in page and "url(" not in page
    for link in reader.links:
        assert link.startswith("data:image/png;base64,")
        assert base64.b64decode(link.partition(",")[2]).startswith(PNG)
    return reader


def drawing() -> Figure:
    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1], [1, 3])
    return figure


def test_page_is_one_file_with_its_pictures_inside() -> None:
    page = Page("Title", "Lead")
    page.heading("One")
    page.paragraph("Text")
    page.cards([("3 mm", "error")])
    page.table(["a", "b"], [["1", "2"], ["3", "4"]], best=1)
    page.figure(drawing(), "A line")
    reader = check_self_contained(page.render())
    assert len(reader.links) == 1
    assert reader.rows == [["a", "b"], ["1", "2"], ["3", "4"]]
    assert page.render().count("class=best") == 1


def test_names_with_markup_are_shown_and_not_executed() -> None:
    evil = "<script>alert('x')</script> & \"quoted\""
    page = Page(evil, evil)
    page.heading(evil)
    page.paragraph(evil)
    page.cards([(evil, evil)])
    page.table([evil], [[evil]])
    page.figure(drawing(), evil)
    reader = check_self_contained(page.render())
    assert evil in reader.words


def test_png_of_a_figure_is_a_picture_of_some_size() -> None:
    data = png(drawing())
    assert data.startswith(PNG)
    width, height = (int.from_bytes(data[i : i + 4], "big") for i in (16, 20))
    assert width > 100 and height > 50


def test_page_of_a_closed_loop_tells_what_was_added_and_shows_it() -> None:
    done = command("spool_deadband")
    reader = check_self_contained((done.out / "report.html").read_text(encoding="utf-8"))
    assert "Added: spool_deadband (valve)" in reader.words
    assert "Missing: spool_deadband." in reader.words
    assert "What the extended model gains in the loop" in reader.words
    assert len(reader.links) == 7
    errors = {row[0]: row[1:] for row in reader.rows if len(row) == 5 and row[0].endswith("n)")}
    assert set(errors) == {"learn (estimation)", "hold (validation)"}
    after = done.result.final.validation["hold"]["acceleration"]
    assert errors["hold (validation)"][3] == f"{100 * after:.2f} %"
    assert any(row[0] == "effects.spool_deadband.width" and row[1] == "–" for row in reader.rows if row)


def test_page_of_a_closed_loop_tells_that_nothing_is_missing() -> None:
    done = command("nothing")
    reader = check_self_contained((done.out / "report.html").read_text(encoding="utf-8"))
    assert "Missing: nothing." in reader.words
    assert "Added:" not in reader.words
    assert "Nothing above the noise" in reader.words


def test_page_of_recordings_without_accelerometer_is_drawn() -> None:
    done = command("nothing")
    blind = [Record(r.name, r.sample_time, r.commands, r.position) for r in done.hold]
    noise = {"velocity": done.result.noise["velocity"]}
    page = close_loop_page(dataclasses.replace(done.result, noise=noise), blind, blind)
    reader = check_self_contained(page)
    assert reader.links
    assert "m/s²." not in reader.words


def test_parameter_at_a_bound_says_so() -> None:
    page = Page("a", "b")
    parameter_table(page, {"before": [], "after": [Estimate("x", 2.0, None, "N"), Estimate("y", 3.0, 0.25, "m")]})
    rows = Reader(page.render()).rows
    assert rows[1:] == [["x", "–", "2 (at bound)", "N"], ["y", "–", "3 ± 0.25", "m"]]
    assert text.percent(0.0123) == "1.23 %"
    assert text.percent(None) == "–"


def test_time_histories_show_the_stretch_of_fastest_motion_and_the_better_model_lies_nearer() -> None:
    done = command("spool_deadband")
    record = done.hold[0]
    runs = figures_fit.free_runs(record, done.result.baseline.table, done.result.final.table)
    figure = figures_fit.time_histories(record, *runs, seconds=0.5)
    assert len(figure.axes) == 2
    for axes in figure.axes:
        measured, before, after = (line.get_ydata() for line in axes.lines)
        assert len(measured) == round(0.5 / SAMPLE_TIME)
        assert np.std(measured - after) < 0.3 * np.std(measured - before)
    span = figures_fit.fastest_stretch(record, 0.5)
    rest = np.mean(record.velocity[record.start :] ** 2)
    assert np.mean(record.velocity[span] ** 2) > rest


def test_spectrum_of_the_residual_falls_with_the_effect() -> None:
    done = command("spool_deadband")
    record = done.hold[0]
    runs = figures_fit.free_runs(record, done.result.baseline.table, done.result.final.table)
    measured, before, after = (line.get_ydata() for line in figures_fit.spectra(record, *runs).axes[0].lines)
    assert np.sum(after**2) < 0.1 * np.sum(before**2)
    assert np.sum(before**2) < np.sum(measured**2)


def test_residual_against_what_the_effect_depends_on_is_flat_afterwards() -> None:
    done = command("spool_deadband")
    record = done.hold[0]
    runs = figures_fit.free_runs(record, done.result.baseline.table, done.result.final.table)
    figure = figures_fit.residual_figure(record, *runs, ["valve_opening"], 650.0)
    (axes,) = figure.axes
    assert "opening" in axes.get_xlabel()
    means = [line.get_ydata() for line in axes.lines if line.get_label() in ("declared", "extended")]
    assert np.ptp(means[1]) < 0.5 * np.ptp(means[0])


def test_ranking_has_a_bar_for_the_declared_model_and_each_candidate() -> None:
    step = named("spool_deadband").search.steps[0]
    (axes,) = figures_fit.ranking_figure(step.ranking, 100.0).axes
    labels = [t.get_text() for t in axes.get_yticklabels()]
    assert labels == ["declared model", *(a.candidate.effect for a in reversed(step.ranking))]
    assert axes.patches[-1].get_width() == pytest.approx(np.sqrt(step.chosen.result.validation_cost))


def test_lines_of_the_terminal_hold_values_errors_and_alternatives() -> None:
    done = command("spool_deadband")
    lines = text.parameter_lines(done.result.final.parameters)
    assert len(lines) == 1 + len(done.result.final.parameters)
    width = next(line for line in lines if "spool_deadband" in line)
    assert re.search(r"effects\.spool_deadband\.width +0\.0\d+ +[\d.e-]+  -$", width)
    assert "at bound" in text.parameter_lines([Estimate("x", 1.0, None, "N")])[1]
    step = dataclasses.replace(done.result.search.steps[0], alternatives=("slow_valve",))
    search = dataclasses.replace(done.result.search, steps=(step,))
    told = "\n".join(text.close_loop_lines(dataclasses.replace(done.result, search=search)))
    assert "(these recordings cannot tell it from slow_valve)" in told
