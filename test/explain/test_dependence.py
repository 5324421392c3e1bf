"""What a residual depends on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_loops import named

from shake_ros.explain.dependence import band_share, explained_share, remaining, without_single
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.physics.effects import PLACES

GROUPS = 24
X = np.linspace(-1.0, 1.0, 24000)
NAMES = {"position", "velocity", "direction", "load_pressure", "valve_opening", "flow", "time", "frequency"}


def test_line_is_explained_but_for_its_rise_within_the_groups() -> None:
    closed = 1.0 - 1.0 / GROUPS**2
    assert explained_share(X, X, GROUPS) == pytest.approx(closed, abs=2e-3)


def test_noise_on_a_function_takes_its_share_of_the_variance() -> None:
    noise = np.random.default_rng(0).standard_normal(len(X))
    step = np.sign(X)
    assert explained_share(step + 2.0 * noise, X, GROUPS) == pytest.approx(1.0 / 5.0, abs=0.02)


def test_chance_explains_nothing() -> None:
    rng = np.random.default_rng(1)
    for _ in range(5):
        assert explained_share(rng.standard_normal(2400), rng.standard_normal(2400), GROUPS) < 0.015


def test_direction_has_two_groups_and_explains_what_changes_with_it() -> None:
    direction = np.sign(np.sin(40.0 * X))
    assert explained_share(3.0 * direction, direction, GROUPS) == pytest.approx(1.0, abs=1e-3)
    assert explained_share(np.cos(40.0 * X), direction, GROUPS) < 0.01


def test_quantity_that_stands_still_explains_nothing() -> None:
    assert explained_share(X, np.zeros_like(X), GROUPS) < 1e-12


def test_narrow_band_is_found_at_its_frequency() -> None:
    time = np.arange(20000) * 0.001
    noise = 0.1 * np.random.default_rng(2).standard_normal(len(time))
    share, centre = band_share(np.sin(2.0 * np.pi * 7.0 * time) + noise, 0.001)
    assert share > 0.9
    assert centre == pytest.approx(7.0, rel=0.13)
    assert band_share(noise, 0.001)[0] < 0.4


def test_nothing_remains_above_the_noise_of_a_table_of_the_declared_kind() -> None:
    found = named("nothing")
    rest = remaining(found.problem, found.search)
    assert not rest.above_noise
    assert rest.place is None
    assert rest.depends_on == ()
    assert 0.7 < rest.ratio < 1.15
    assert rest.text.startswith("nothing above the noise")


def test_nothing_remains_above_the_noise_once_the_effect_is_added() -> None:
    found = named("soft_zone")
    assert not remaining(found.problem, found.search).above_noise


def test_what_the_declared_model_leaves_of_a_valve_with_unequal_edges_goes_with_direction() -> None:
    found = named("asymmetric_flow_gain")
    declared = found.search.declared
    without = type(found.search)(declared, (), declared)
    rest = remaining(found.problem, without)
    assert rest.above_noise
    assert rest.ratio > 5.0
    assert set(rest.depends_on) <= NAMES
    assert {"direction", "valve_opening", "velocity", "flow"} & set(rest.depends_on)
    assert rest.place in PLACES
    assert "× the sensor noise; it depends on" in rest.text or "mostly near" in rest.text


def test_single_samples_are_told_apart_from_what_is_there_all_the_time() -> None:
    noise = np.random.default_rng(5).standard_normal(6000)
    spiked, shaken = noise.copy(), noise * np.where(np.arange(6000) % 50 == 0, 20.0, 1.0)
    spiked[[100, 4000]] = 150.0
    most, few = without_single(spiked)
    assert few == 6
    assert most == pytest.approx(1.0, abs=0.03)
    assert float(np.sqrt(np.mean(spiked**2))) > 2.5
    assert without_single(shaken)[0] > 2.5


def test_an_answer_does_not_hang_on_one_sample() -> None:
    found = named("nothing")
    records = list(found.problem.validation.records)
    acceleration = np.array(records[0].acceleration)
    acceleration[len(acceleration) // 2] += 40.0
    spoilt = replace(records[0], acceleration=acceleration)
    validation = RecordingProblem([spoilt, *records[1:]], found.problem.validation.model)
    rest = remaining(replace(found.problem, validation=validation), found.search)
    assert rest.ratio > 1.5
    assert not rest.above_noise
    assert "single samples" in rest.text
