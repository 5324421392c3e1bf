"""A function of two quantities in text, chart and report."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from shake_ros.physics.effects import unlisted as law
from shake_ros.report.charts_fit import unlisted_chart
from shake_ros.report.report_json import function_json
from shake_ros.report.text import function_line
from shake_ros.search.closed_form import LearntChange, LearntFunction, fitted_changes, fitted_forms
from shake_ros.settings import load_table

AT, CHANGES_AT = np.linspace(-0.03, 0.03, law.NODES), np.linspace(-0.03, 0.03, law.CHANGES)
SPRING = fitted_forms(AT, 3e4 * AT, np.ones(law.NODES))[0]
ABOVE, BELOW = -0.5 * 3e4 * CHANGES_AT, 1.0 * 3e4 * CHANGES_AT  # a spring that fades with time


def learnt(*, fading: bool) -> LearntFunction:
    one = np.ones(law.CHANGES)
    form = fitted_changes(3e4 * CHANGES_AT, np.array([ABOVE, BELOW]), np.array([one, one]))[0]
    unknown = np.where(np.arange(law.CHANGES) == 0, np.nan, one)
    change = LearntChange("time", 0.0, 8.0, CHANGES_AT, ABOVE, BELOW, unknown, one, form)
    spread = np.ones(law.NODES)
    return LearntFunction("position", "force", "N", AT, 3e4 * AT, spread, SPRING, change if fading else None)


def test_text_tells_of_both_quantities_and_how_the_function_changes() -> None:
    line = function_line(learnt(fading=True))
    assert line.startswith("function of position and time [N], closed form, where time is 4 s: line, a + b s with")
    assert "with time it changes as separable, f(s) (1 + c⁺ max(τ, 0) + c⁻ max(−τ, 0)) with c⁺ = -0.5, c⁻ = 1," in line
    assert "τ from −1 at 0 s to 1 at 8 s" in line
    assert function_line(learnt(fading=False)).startswith("function of position [N], closed form: line")


def test_report_has_the_change_with_null_where_no_standard_error_is_known() -> None:
    content = function_json(learnt(fading=True))["second"]
    assert (content["quantity"], content["unit"], content["low"], content["high"]) == ("time", "s", 0.0, 8.0)
    assert content["above"] == pytest.approx(list(ABOVE))
    assert content["above_std_errors"] == [None] + [1.0] * (law.CHANGES - 1)
    assert content["closed_form"]["name"] == "separable"
    assert function_json(learnt(fading=False))["second"] is None


def test_chart_shows_the_function_at_the_ends_and_in_the_middle_of_the_second_quantity() -> None:
    own = {f"effects.unlisted.node_{i:02d}": float(v) for i, v in enumerate(3e4 * AT)}
    own |= {f"effects.unlisted.above_{i}": float(v) for i, v in enumerate(ABOVE)}
    own |= {f"effects.unlisted.below_{i}": float(v) for i, v in enumerate(BELOW)}
    ends = {"low": -0.03, "high": 0.03, "second": law.TIME, "second_low": 0.0, "second_high": 8.0}
    own |= {"effects.unlisted.kind": law.FORCE_OF_POSITION} | {f"effects.unlisted.{k}": v for k, v in ends.items()}
    fit = SimpleNamespace(table=load_table("bergamo").with_values(own))
    (panel,) = unlisted_chart(cast("Any", fit), SPRING).panels
    assert [s.label for s in panel.series] == ["time 0 s", "time 4 s", "time 8 s", "line"]
    for series, factor in zip(panel.series, (2.0, 1.0, 0.5, 1.0), strict=True):
        np.testing.assert_allclose(series.values, factor * 3e4 * 1e-3 * panel.x, rtol=1e-3, atol=1e-3)
