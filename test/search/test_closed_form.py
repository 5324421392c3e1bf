"""Closed forms recognised from nodes."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.search.closed_form import fitted_forms

AT = np.linspace(-0.1, 0.1, 16)  # [m]


def test_a_bump_is_found_with_its_place_and_width_in_units_of_the_argument() -> None:
    noise = np.random.default_rng(0).normal(0.0, 5.0, 16)
    best = fitted_forms(AT, 400.0 * np.exp(-0.5 * ((AT - 0.03) / 0.015) ** 2) + noise, np.full(16, 5.0))[0]
    assert best.name == "bump"
    assert best.parameters["a"] == pytest.approx(400.0, rel=0.1)
    assert best.parameters["m"] == pytest.approx(0.03, abs=0.003)
    assert abs(best.parameters["w"]) == pytest.approx(0.015, rel=0.15)


def test_a_spring_behind_a_clearance_is_told_from_a_cubic_one() -> None:
    force = 2e4 * np.sign(AT) * np.maximum(np.abs(AT) - 0.05, 0.0)
    best = fitted_forms(AT, force, np.full(16, 10.0))[0]
    assert best.name == "stops"
    assert best.parameters["a"] == pytest.approx(2e4, rel=0.02)
    assert abs(best.parameters["g"]) == pytest.approx(0.05, rel=0.02)


def test_nodes_that_nothing_is_known_of_do_not_decide() -> None:
    values, deviations = 50.0 * AT, np.full(16, 0.05)
    values[[0, 15]], deviations[[0, 15]] = 300.0, np.nan
    best = next(f for f in fitted_forms(AT, values, deviations) if f.name == "line")
    assert best.parameters["b"] == pytest.approx(50.0, rel=0.2)
