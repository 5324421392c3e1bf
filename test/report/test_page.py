"""The pages: self-contained, complete, with charts that are drawn from the results."""

from __future__ import annotations

import base64
import dataclasses
import math
import re
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pytest
from closed_loops import command
from hidden_table import SAMPLE_TIME
from pages import Reader, read_page

from shake_ros.fit.records import Record
from shake_ros.fit.uncertainty import Estimate
from shake_ros.report import charts_fit, text
from shake_ros.report.chart import Chart, ChartSeries, Panel, packed, save_figures, static_figure
from shake_ros.report.close_loop_page import effect_text, found_section, model_sections
from shake_ros.report.page import LARGEST, Bar, Page, Source
from shake_ros.report.report_json import found_effect
from shake_ros.report.sections import hydraulic_table
from shake_ros.report.text import estimate_text, unit_of
from shake_ros.search.closed_form import LearntFunction, fitted_forms
from shake_ros.search.verdict import EffectVerdict

NOON = datetime(2026, 1, 2, 12, 0, tzinfo=timezone.utc)


def line(count: int = 2, name: str = "line") -> Chart:
    x = np.arange(count, dtype=np.float64)
    return Chart(name, "time [s]", (Panel("y [m]", x, (ChartSeries("a", x**2, "c0"),)),), "A line")


def unpacked(column: object) -> np.ndarray:
    """A column of a chart's JSON as the page's script reads it."""
    if isinstance(column, list):
        return np.array([np.nan if v is None else v for v in column])
    assert isinstance(column, dict)
    if "count" in column:
        return column["start"] + column["step"] * np.arange(column["count"])
    steps = np.frombuffer(base64.b64decode(column["data"]), dtype="<i2").astype(float)
    return np.where(steps == -32768, np.nan, column["low"] + (steps + 32767) * column["step"])


def test_page_is_one_file_with_its_charts_inside() -> None:
    page = Page("Title", "Lead", [Source("run1", "estimation", 2.0, 2000, 1000.0)])
    page.heading("One")
    page.paragraph("Text")
    page.cards([("3 mm", "error")])
    page.table(["a", "b"], [["1", Bar(0.5, "2")], ["3", "4"]], best=1, warn=[0])
    page.matrix(["p", "q"], np.array([[1.0, -0.5], [-0.5, np.nan]]))
    page.chart(line())
    made = page.render(NOON, "./shake x --out y")
    reader = read_page(made)
    assert reader.headings == ["One", "Where this comes from"]
    assert reader.rows[:3] == [["a", "b"], ["1", "2"], ["3", "4"]]
    assert ["p", "1.00", "−0.50"] in reader.rows
    assert made.count("class=best") == 1 == made.count("class=warn")
    assert "2026-01-02 12:00 UTC" in reader.words and "./shake x --out y" in reader.words
    assert ["run1", "estimation", "2.00 s", "2000", "1000 Hz"] in reader.rows
    assert [c["name"] for c in reader.charts] == ["line"]


def test_names_with_markup_are_shown_and_not_executed() -> None:
    evil = "</script><script>alert('x')</script> & \"quoted\""
    page = Page(evil, evil)
    page.heading(evil)
    page.paragraph(evil)
    page.cards([(evil, evil)])
    page.table([evil], [[evil]])
    page.chart(dataclasses.replace(line(), caption=evil, x=evil))
    reader = read_page(page.render(command=evil))
    assert evil in reader.words
    assert reader.charts[0]["x"] == evil
    assert "alert" not in reader.code


def test_terminal_shows_what_the_page_shows_but_charts_notes_and_details() -> None:
    page = Page("Title", "Lead")
    page.heading("Charts alone")
    page.subheading("One")
    page.chart(line())
    page.heading("Found")
    page.paragraph("A note", note=True)
    page.cards([("3 mm", "error"), ("coulomb_friction", "missing")])
    page.table(["run", "error"], [["a", Bar(0.5, "1.5 %")], ["bc", "12.0 %\nat its bound"]])
    page.subheading("More", detail=True)
    page.paragraph("for the page")
    page.subheading("Again")
    page.paragraph("for both")
    page.heading("Details", detail=True)
    page.subheading("of them")
    page.paragraph("for the page")
    assert page.text() == (
        "Title\nLead\n\nFound\n3 mm              error\ncoulomb_friction  missing\n\n"
        "run                error\na                  1.5 %\nbc   12.0 % at its bound\n\nAgain\nfor both"
    )
    assert "class=note" not in page.brief()
    assert page.render(NOON) == page.render(NOON)
    assert "for the page" in page.render()


def test_same_data_give_the_same_bytes_but_for_the_date(tmp_path: Path) -> None:
    def made(now: datetime) -> str:
        page = Page("a", "b")
        page.chart(line(5000))
        return page.render(now)

    later = datetime(2026, 1, 2, 12, 1, tzinfo=timezone.utc)
    assert made(NOON) == made(NOON)
    assert made(NOON).replace("12:00 UTC", "") == made(later).replace("12:01 UTC", "")
    for kind in ("pdf", "svg", "png"):
        save_figures([line(100)], tmp_path / "one", kind)
        save_figures([line(100)], tmp_path / "two", kind)
        assert (tmp_path / "one" / f"line.{kind}").read_bytes() == (tmp_path / "two" / f"line.{kind}").read_bytes()


def test_packed_columns_come_back_within_a_part_of_their_range() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=1000)
    values[7] = np.nan
    again = unpacked(packed(values))
    assert np.isnan(again[7])
    assert np.nanmax(np.abs(again - values)) <= np.ptp(values[~np.isnan(values)]) / 65534
    assert np.allclose(unpacked(packed(3.0 + 0.001 * np.arange(60000))), 3.0 + 0.001 * np.arange(60000), atol=1e-9)
    assert np.array_equal(unpacked(packed(np.full(300, 2.5))), np.full(300, 2.5))


def test_thirteen_minutes_stay_below_the_limit_and_keep_every_peak() -> None:
    rng = np.random.default_rng(0)
    n = 800_000
    time, measured = np.arange(n) * 0.001, rng.normal(size=n)
    measured[123_457] = 50.0
    rest = 0.1 * rng.normal(size=n)
    series = (ChartSeries("measured", measured, "measured"), ChartSeries("model", measured, "after", minus=rest))
    other = ChartSeries("other", rng.normal(size=n), "c0")
    page = Page("a", "b")
    page.chart(
        Chart(
            "long", "time [s]", (Panel("y", time, series), Panel("r", time, (ChartSeries("r", rest, "c0"), other))), "c"
        )
    )
    made = page.render()
    reader = read_page(made)
    assert len(made) < LARGEST + 200_000
    columns = [unpacked(c) for c in reader.charts[0]["columns"]]
    assert max(c.max() for c in columns[1:2]) == pytest.approx(50.0, abs=0.01)
    at = columns[0][int(np.argmax(columns[1]))]
    assert abs(at - 123.457) < 0.1
    assert "least and largest of every" in reader.words


def test_one_minute_of_two_recordings_is_kept_whole() -> None:
    rng = np.random.default_rng(0)
    page = Page("a", "b")
    for k in range(2):
        time, values = np.arange(60_000) * 0.001, rng.normal(size=(6, 60_000))
        series = [ChartSeries(str(i), v, "c0") for i, v in enumerate(values)]
        page.chart(Chart(f"run{k}", "time [s]", (Panel("y", time, tuple(series)),), "c"))
    made = page.render()
    assert "least and largest" not in read_page(made).words


def test_page_of_a_closed_loop_answers_in_the_order_of_the_questions() -> None:
    done = command("spool_deadband")
    reader = read_page((done.out / "report.html").read_text(encoding="utf-8"))
    assert reader.headings == [
        "What was found, and how certain it is",
        "Measured against simulated",
        "Errors",
        "Why spool_deadband and not another",
        "What remains",
        "The force that the model lacks",
        "How much the extended model improves tracking",
        "Parameters",
        "What to record next",
        "Observer and controller for the table",
        "Where this comes from",
    ]
    assert "Missing: spool_deadband." in reader.words
    assert f"./shake close_loop --learn {done.out.parent / 'learn'}" in reader.words
    after = done.result.final.validation["hold"]["acceleration"]
    errors = [row for row in reader.rows if row[:2] == ["hold", "validation"]]
    assert errors[0][5] == f"{100 * after:.2f} %"
    assert any(row[0] == "spool_deadband.width" and row[1] == "–" for row in reader.rows if row)
    assert any(row[0] == "learn" and row[2] == "3.00 s" for row in reader.rows)


def test_sizes_of_the_ranking_are_in_one_measure_and_their_bars_start_at_zero() -> None:
    done = command("spool_deadband")
    page = (done.out / "report.html").read_text(encoding="utf-8")
    rows = {row[0]: row for row in read_page(page).rows if len(row) == 6}
    step, search = done.result.search.steps[0], done.result.search
    best, without = math.sqrt(step.chosen.score), math.sqrt(search.declared.score)
    assert rows["spool_deadband"][1:3] == [f"{best:#.3g}", "added"]
    assert rows["without"][1] == f"{without:#.3g}"
    words = " ".join(read_page(page).words.split())
    assert f"It reduces the residual from {without:#.3g} to {best:#.3g} times the noise" in words
    widths = [float(w) for w in re.findall(r"<td class='bar'><i style='width:([\d.]+)rem'>", page)]
    assert widths[1] / widths[0] == pytest.approx(best / without, rel=0.02)


def test_page_of_a_closed_loop_tells_that_nothing_is_missing() -> None:
    done = command("nothing")
    reader = read_page((done.out / "report.html").read_text(encoding="utf-8"))
    assert "Missing: nothing." in reader.words
    assert not any(heading.startswith("Why") for heading in reader.headings)
    assert "Nothing above the noise" in reader.words
    assert "independent" not in reader.words


def test_page_of_recordings_without_accelerometer_is_drawn() -> None:
    done = command("nothing")
    blind = [Record(r.name, r.sample_time, r.commands, r.position) for r in done.hold]
    noise = {"velocity": done.result.noise["velocity"]}
    page = Page("a", "b")
    model_sections(page, dataclasses.replace(done.result, noise=noise), blind, blind)
    reader = read_page(page.render())
    panels = [panel["y"] for chart in reader.charts for panel in chart["panels"]]
    assert "velocity [m/s]" in panels and "acceleration [m/s²]" not in panels


def test_uncertainty_is_reported_only_where_it_means_something() -> None:
    assert estimate_text(Estimate("x", 0.059, 260.0, "-")) == "not known (0.059)"
    assert estimate_text(Estimate("x", 2.0e7, 3.0e5, "Pa")) == "20.00 ± 0.30"
    assert unit_of("Pa")[1] == "MPa"
    assert text.percent(0.0123) == "1.23 %"
    assert text.percent(None) == "–"


def test_parameter_at_a_bound_says_at_which_and_is_marked() -> None:
    done = command("spool_deadband")
    resting = [p.name for p in done.result.baseline.parameters if p.std_error is None]
    page = read_page((done.out / "report.html").read_text(encoding="utf-8"))
    rows = {row[0]: row for row in page.rows if len(row) == 5 and row[0] != "parameter"}
    ends = {f.name: (f.low, f.high) for f in done.result.baseline.fit.free.free}
    assert resting
    for name in resting:
        shown, _, place = rows[name][1].partition(",")
        place = place.strip()
        assert place in ("at its lower bound", "at its upper bound", "does not act")
        if place != "does not act":
            bound = Estimate(
                name, ends[name]["upper" in place], None, done.result.baseline.fit.table.fields[name].metadata["unit"]
            )
            assert shown == estimate_text(bound)


def test_betas_are_reported_as_hydraulic_frequency_damping_and_gain() -> None:
    betas = {"beta1": -((2.0 * np.pi * 16.0) ** 2), "beta2": -20.0, "beta3": 4000.0, "beta4": -2.0, "beta5": 0.0}

    class Model:
        parameters = tuple(Estimate(f"dynamics.{name}", value, 1.0, "") for name, value in betas.items())

    page = Page("a", "b")
    hydraulic_table(page, {"fitted": Model()})  # type: ignore[dict-item]
    closed = Reader(page.render()).rows[1]
    omega = 2.0 * np.pi * 16.0
    assert closed[2:] == ["16.00 Hz", f"{20.0 / (2.0 * omega):.3f}", f"{4000.0 / omega**2:.3f} m/s"]


def histories() -> tuple[Record, tuple[np.ndarray, np.ndarray]]:
    done = command("spool_deadband")
    record = done.hold[0]
    return record, charts_fit.free_runs(record, done.result.baseline.table, done.result.final.table)


def test_histories_hold_the_whole_recording_and_show_the_stretch_of_fastest_motion() -> None:
    record, runs = histories()
    chart = charts_fit.history_chart(record, runs, seconds=0.5)
    assert [p.y for p in chart.panels][::2] == ["velocity [m/s]", "acceleration [m/s²]"]
    for upper, lower in zip(chart.panels[::2], chart.panels[1::2], strict=True):
        measured, before, after = (s.drawn for s in upper.series)
        assert len(measured) == len(record.commands) - record.start
        assert np.std(measured - after) < 0.3 * np.std(measured - before)
        assert np.allclose([s.drawn for s in lower.series], [measured - before, measured - after], atol=1e-12)
    assert chart.view is not None
    assert chart.view[1] - chart.view[0] == pytest.approx(0.5, abs=2 * SAMPLE_TIME)
    span = charts_fit.fastest_segment(record, 0.5)
    assert np.mean(record.velocity[span] ** 2) > np.mean(record.velocity[record.start :] ** 2)
    seen = static_figure(chart).axes[0].lines[0].get_xdata()
    assert len(seen) == pytest.approx(0.5 / SAMPLE_TIME, abs=2)


def test_squares_of_the_bands_add_up_to_the_square_of_the_error() -> None:
    done = command("spool_deadband")
    record, runs = histories()
    _, rows = charts_fit.band_errors(record, runs)
    for k, model in enumerate((done.result.baseline, done.result.final)):
        whole = math.sqrt(sum(errors[k] ** 2 for _, errors in rows))
        assert whole == pytest.approx(model.validation["hold"]["acceleration"], rel=1e-9)


def test_spectrum_of_the_residual_falls_with_the_effect() -> None:
    record, runs = histories()
    measured, before, after = (s.values for s in charts_fit.spectrum_chart(record, runs).panels[0].series)
    assert np.sum(after**2) < 0.1 * np.sum(before**2)
    assert np.sum(before**2) < np.sum(measured**2)


def test_residual_against_what_the_effect_depends_on_is_flat_afterwards() -> None:
    record, runs = histories()
    (chart,) = charts_fit.residual_charts(record, runs, ["valve_opening"], 650.0)
    assert "opening" in chart.x
    before, after = (s.values for s in chart.panels[0].series)
    assert np.ptp(after) < 0.5 * np.ptp(before)


def test_lines_of_the_terminal_hold_values_errors_and_alternatives() -> None:
    done = command("spool_deadband")
    lines = str(text.parameter_table(done.result.final.parameters)).splitlines()
    assert len(lines) == 1 + len(done.result.final.parameters)
    width = next(line for line in lines if "spool_deadband" in line)
    assert re.search(r"effects\.spool_deadband\.width +0\.0\d+ +[\d.e-]+ +[\d.e-]+ +-$", width)
    assert "at bound" in str(text.parameter_table([Estimate("x", 1.0, None, "N")]))
    (verdict,) = done.result.verdicts
    verdicts = (dataclasses.replace(verdict, alternatives=("slow_valve",)),)
    page = Page("a", "b")
    found_section(page, dataclasses.replace(done.result, verdicts=verdicts), None)
    assert "These recordings cannot distinguish it from slow_valve." in page.text()


def test_effect_that_shows_is_not_reported_as_distinguished_from_untried_ones() -> None:
    done = command("spool_deadband").result
    (step,) = done.search.steps
    alone, beside = (
        effect_text(found_effect(dataclasses.replace(step, ranking=(step.chosen,) * n), done.final)) for n in (1, 3)
    )
    assert "No other effect was refitted to free runs in its place." in alone
    assert "from the 2 other effects" in beside


def test_unlisted_function_is_described_by_what_it_depends_on_and_its_form() -> None:
    done = command("spool_deadband").result
    (step,) = done.search.steps
    effect = dataclasses.replace(
        step.chosen.candidate, effect="unlisted", place="force", depends_on=("load_pressure",), free=()
    )
    chosen = dataclasses.replace(step.chosen, candidate=effect)
    at, deviations = np.linspace(-0.03, 0.03, 16), np.full(16, 1.0)
    values = 9e5 * np.sign(at) * np.maximum(np.abs(at) - 0.01, 0.0)
    form = fitted_forms(at, values, deviations)[0]
    function = LearntFunction("position", "force", "N", at, values, deviations, form)
    told = effect_text(found_effect(dataclasses.replace(step, chosen=chosen), done.final), function)
    assert told.startswith("a function of load pressure with the form stops (force). ")


def test_what_is_not_established_is_not_called_nothing_missing_and_has_its_figures() -> None:
    found = command("nothing").result
    candidate = EffectVerdict("coulomb_friction", "friction", "not established", 0.5, 1.35, "worth little")
    errors = {"held": {"velocity": 0.185, "acceleration": 0.251}}
    page = Page("a", "b")
    found_section(page, dataclasses.replace(found, candidates=(candidate,), with_candidates=errors), None)
    words = read_page(page.render()).words
    assert "nothing established" in words
    assert "With it in the model the error of velocity and acceleration on validation data would be" in words
    assert "held 18.50 % and 25.10 %" in words
    velocity = {"held": {"velocity": 0.185}}
    both = dataclasses.replace(found, candidates=(candidate, candidate), with_candidates=velocity)
    page = Page("a", "b")
    found_section(page, both, None)
    words = read_page(page.render()).words
    assert "With all of these in the model the error of velocity on validation data would be held 18.50 %." in words
