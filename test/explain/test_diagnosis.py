"""Diagnosis of a fit: a model that lacks nothing passes the tests, one that does fails them."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.explain.account import Account
from shake_ros.explain.diagnosis import Diagnosis, diagnose
from shake_ros.fit.free_parameters import FreeParameters, free_parameter
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table

TABLE = load_table("bergamo").with_values({"friction.coulomb_level": 400.0})
NOISE = 0.05


def recorded(table: TableParameters, seed: int, acceleration: bool = True) -> Record:
    rng = np.random.default_rng(seed)
    time = np.arange(3000) * 1e-3
    command = 0.15 * sum(np.cos(2.0 * np.pi * f * time + rng.uniform(0.0, 6.0)) for f in (0.7, 1.9, 3.3, 7.1))
    out = run(table, command, 1e-3)
    position = out[:, 0] + 8e-6 * rng.standard_normal(3000)
    felt = out[:, 2] + NOISE * rng.standard_normal(3000)
    return Record(f"run{seed}", 1e-3, command, position, felt if acceleration else None)


def diagnosed(truth: TableParameters, acceleration: bool = True) -> Diagnosis:
    learn, hold = [recorded(truth, 1, acceleration)], [recorded(truth, 2, acceleration)]
    names = {"friction.coulomb_level": {"scale": 50.0}, "valve.flow_coefficient": {"scale": 1e-8}}
    free = FreeParameters(TABLE, [free_parameter(n, c, "here") for n, c in names.items()])
    result = fit(RecordingProblem(learn), free, free.start(), evaluations=10)
    return diagnose(result, learn, hold, ())


def account(truth: TableParameters, acceleration: bool = True) -> tuple[Account, ...]:
    """Of the channel that is tested, one of each recording."""
    return tuple(each for each in diagnosed(truth, acceleration).accounts if each.shape)


def test_what_no_recording_was_asked_for_is_not_said_to_be_impossible() -> None:
    assert diagnosed(TABLE).advice == "no time was left to find the most helpful further recording"


def test_a_model_that_lacks_nothing_leaves_noise_in_every_recording() -> None:
    first, second = account(TABLE)
    assert (first.name, first.held_out, second.name, second.held_out) == ("run1", False, "run2", True)
    for each in (first, second):
        assert each.shape is not None
        assert each.shape.independent
        assert each.noise_share > 0.9
        assert each.noise == pytest.approx(NOISE, rel=0.1)


def test_a_table_with_a_soft_zone_leaves_a_residual_that_is_not_noise() -> None:
    soft = TABLE.with_values(
        {
            "effects.soft_zone.depth": 0.8,
            "effects.soft_zone.threshold": 9e5,
            "effects.soft_zone.sharpness": 8.8e-6,
        }
    )
    for each in account(soft):
        assert each.shape is not None
        assert not each.shape.white
        assert each.noise_share < 0.5


def test_without_an_accelerometer_the_velocity_is_tested_at_its_independent_samples() -> None:
    for each in account(TABLE, acceleration=False):
        assert each.channel == "velocity"
        assert each.shape is not None
        samples = (2.5758 / each.shape.auto_bound) ** 2  # of 2.5 s, one every 12 ms
        assert samples == pytest.approx(2500 / 12, rel=0.01)
