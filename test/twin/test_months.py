"""Months of a table: trends, steps and the date of maintenance, from readings and from recordings of a simulator."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shake_ros as sr
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.recordings.bags import write_table_recording
from shake_ros.settings import load_table
from shake_ros.twin.follow import follow
from shake_ros.twin.followed import load_twin
from shake_ros.twin.months import DAY, TREND, Readings
from shake_ros.twin.page import month_lines

START = 1_767_225_600 * 10**9  # 2026-01-01
INTERNAL, FLOW = "leakage.internal", "valve.flow_coefficient"


def made(values: np.ndarray, deviation: float, seed: int = 0, days: float = 7.0) -> Readings:
    """Readings of a parameter every so many days, with what is found in them."""
    stamps = START + np.rint(np.arange(len(values)) * days * DAY).astype(np.int64)
    noise = deviation * np.random.default_rng(seed).standard_normal(len(values))
    return Readings("leakage.internal", "-", stamps, values + noise, np.full(len(values), deviation)).explained()


def test_a_trend_and_a_step_are_found_together_with_their_sizes() -> None:
    k = np.arange(24)
    found = made(1.0 + 0.02 * k + 0.5 * (k >= 15), 0.02)
    assert found.terms == (TREND, 15)
    assert found.trend is not None
    assert found.trend[0] == pytest.approx(0.02 / 7.0, abs=4.0 * found.trend[1])
    ((at, size, deviation),) = found.steps
    assert (at, size) == (15, pytest.approx(0.5, abs=4.0 * deviation))


def test_nothing_is_found_where_nothing_changes() -> None:
    found = [made(np.ones(24), 0.05, seed).terms for seed in range(40)]
    assert sum(bool(terms) for terms in found) <= 4


def test_readings_that_scatter_by_more_than_their_deviations_show_no_change() -> None:
    scattered = [1.0 + 0.2 * np.random.default_rng(seed).standard_normal(24) for seed in range(20)]
    assert sum(bool(made(values, 0.01).terms) for values in scattered) <= 4


def test_maintenance_is_due_when_the_trend_reaches_the_limit_and_its_interval_covers_the_truth() -> None:
    covered = 0
    for seed in range(40):
        found = made(1.0 + 0.02 * np.arange(12), 0.02, seed)
        due = found.due(-math.inf, 1.6)
        assert due is not None
        covered += due[1] <= 30 * 7 <= due[2]
    assert 30 <= covered <= 40


def test_no_date_without_a_trend_and_none_away_from_the_limit() -> None:
    assert made(np.ones(12), 0.02).due(0.0, 1.1) is None
    assert made(1.0 - 0.02 * np.arange(12), 0.02).due(-math.inf, 1.1) is None


def test_the_lines_say_since_when_and_until_when() -> None:
    k = np.arange(24)
    step, trend = month_lines(made(1.0 + 0.02 * k + 0.5 * (k >= 15), 0.02), (-math.inf, 3.0))
    assert step.startswith("leakage.internal changed by 0.")
    assert step.endswith("between 2026-04-09 and 2026-04-16")
    assert "in 30 days; it reaches 3 " in trend


def test_simulated_months_show_the_leakage_that_grows_and_the_valve_that_was_changed(tmp_path: Path) -> None:
    truth = hidden.declared_truth(71)
    table = load_table("bergamo").with_values({n: getattr(truth, f) for n, f in hidden.DECLARED.items()})
    count, step, growth = 9, 5, 0.25
    for week in range(count):
        worn = truth._replace(
            internal=truth.internal * (1.0 + growth * week), flow=truth.flow * (0.9 if week >= step else 1.0)
        )
        rng = np.random.default_rng(week)
        made = hidden.record(worn, hidden.multisine(8.8 if week == 0 else 4.6, 1, 0.5, 8.0, 0.2, rng), 1.0, rng, 20)
        write_table_recording(
            *(tmp_path / "archive" / f"week_{week}", np.arange(len(made["command"])) * hidden.SAMPLE),
            *(made["command"], made["position"], made["acceleration"]),
            first_stamp=START + week * 7 * DAY,
        )
    settings = load_twin()
    quick = replace(settings, test=settings.test.replace(reference=6.0))
    found = follow(sr.read(tmp_path / "archive"), table, settings=quick, progress=False)
    by_name = {r.name: r for r in found.months}
    leakage, flow = by_name[INTERNAL], by_name[FLOW]
    assert leakage.trend is not None
    assert leakage.trend[0] * 7.0 == pytest.approx(growth * truth.internal, rel=0.3)
    assert [k for k, *_ in flow.steps] == [step - (count - len(flow.values))]
    assert flow.steps[0][1] == pytest.approx(-0.1 * truth.flow, rel=0.3)
    assert any(line.startswith("leakage.internal changes by") and "it reaches" in line for line in found.lines)
    found.report(tmp_path / "out")
    months = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))["months"]
    assert {m["name"] for m in months if m["maintenance"]} >= {INTERNAL}
    assert "From day to day" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
