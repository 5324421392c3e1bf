"""Fits that begin with predictor runs: a soft zone, made by the tests' own model; and a model without a predictor."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_table import OWN, SAMPLE_TIME, TRUE, record

from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.axis_model import AXIS
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start.narrow_valleys import INJECTION, approached
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_table

SOFT = next(c for c in effect_candidates() if c.effect == "soft_zone")


def problem(seconds: float = 8.0, **own: float) -> RecordingProblem:
    made = record(5, seconds, **own)
    return RecordingProblem([Record("made", SAMPLE_TIME, made.commands, made.position, made.acceleration)])


def of(table: TableParameters) -> np.ndarray:
    return table.vector()[None, :]


def mean_square(residuals: np.ndarray) -> float:
    return float(np.mean(residuals**2))


def test_predictor_runs_of_a_wrong_table_stay_near_the_measurement_and_those_of_the_right_one_where_they_are() -> None:
    free_runs, true = problem(4.0), load_table("bergamo").with_values(TRUE)
    predictor, wrong = free_runs.predictor(INJECTION), true.with_values({"bulk_modulus.modulus": 0.7 * OWN["modulus"]})
    far, near = (mean_square(p.residuals(of(wrong))) for p in (free_runs, predictor))
    assert near < 0.5 * far
    right, still = (mean_square(p.residuals(of(true))) for p in (free_runs, predictor))
    assert still == pytest.approx(right, rel=0.3)
    assert right < 0.05 * near
    assert np.array_equal(free_runs.predictor(0.0).residuals(of(wrong)), free_runs.residuals(of(wrong)))


def test_a_soft_zone_is_reached_from_oil_of_half_its_stiffness() -> None:
    recorded = problem(soft_zone_depth=0.6)
    base = load_table("bergamo").with_values({"bulk_modulus.modulus": 0.6 * OWN["modulus"]})
    free = FreeParameters(base.with_values(SOFT.trials[1]), [*free_parameters(), *SOFT.free])
    found = approached(recorded, free, free.start(), evaluations=25, tolerance=1e-5)
    assert mean_square(found.residuals) < 1.3 * recorded.noise_cost()
    near = 2.0 * mean_square(recorded.residuals(free.vectors(free.start()))[0])
    direct = approached(recorded, free, free.start(), evaluations=25, tolerance=1e-5, near=near)
    alone = fit(recorded, free, free.start(), evaluations=25, tolerance=1e-5)
    assert direct.evaluations == alone.evaluations  # a start that is near needs no way to it
    assert np.array_equal(direct.x, alone.x)
    assert not np.array_equal(found.x, alone.x)


def test_a_model_without_a_predictor_runs_freely() -> None:
    force = np.sin(np.arange(2000) * 0.01)
    recorded = RecordingProblem([Record("axis", 1e-3, force, np.cumsum(np.cumsum(force)) * 1e-9)], AXIS)
    assert recorded.predictor(INJECTION) is recorded
