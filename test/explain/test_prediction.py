"""Innovations on tables of another simulator: a predictor helps where process noise acts, and not where none does."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.declared import MODELS, model_structure
from shake_ros.explain.prediction import HORIZONS, RATES, Innovations, innovations
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.settings import load_table

FORCE = 100.0  # [N rms]


def found(force: float) -> Innovations:
    """Innovations of the true model on a recording with process noise."""
    truth = hidden.declared_truth(1)._replace(rumble=force)
    made = hidden.record(truth, hidden.excitations(1)["hold_multisine"], 1.0, np.random.default_rng(1))
    record = Record("hold", hidden.SAMPLE, made["command"], made["position"], made["acceleration"])
    structure = model_structure(load_table("bergamo"))
    free = FreeParameters(structure.table, structure.free)
    x = free.x_of({name: getattr(truth, field) for name, field in hidden.DECLARED.items()})
    result = innovations(RecordingProblem([record]), free.vectors(x)[0])
    assert result is not None
    return result


@pytest.fixture(scope="module")
def calm() -> Innovations:
    return found(0.0)


@pytest.fixture(scope="module")
def rumbling() -> Innovations:
    return found(FORCE)


def test_a_predictor_of_the_right_model_does_not_help_without_process_noise(calm: Innovations) -> None:
    assert not calm.helps
    assert calm.relative == pytest.approx([1.0] * len(RATES), abs=0.06)


def test_a_predictor_helps_where_a_random_force_acts(rumbling: Innovations) -> None:
    assert rumbling.helps
    assert rumbling.best >= 40.0
    assert rumbling.relative[0] > 4.0 * min(rumbling.relative)
    assert rumbling.errors["velocity"] == tuple(sorted(rumbling.errors["velocity"], reverse=True))


def test_process_noise_lets_a_prediction_err_more_the_farther_it_goes(calm: Innovations, rumbling: Innovations) -> None:
    assert len(HORIZONS) == len(rumbling.horizons["velocity"])
    for channel in ("velocity", "acceleration"):
        near, _, far = rumbling.horizons[channel]
        assert far > 1.3 * near
        assert max(calm.horizons[channel]) < 1.5


def test_a_model_without_a_predictor_has_no_innovations() -> None:
    structure = model_structure(load_table("bergamo"))
    free = FreeParameters(structure.table, structure.free)
    record = Record("still", 1e-3, np.zeros(2000), 1e-6 * np.random.default_rng(1).standard_normal(2000))
    problem = RecordingProblem([record], MODELS["reduced"])
    assert innovations(problem, free.vectors(free.start())[0]) is None
