"""Runs predicted by a model fitted to the others, on runs that a known table made."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.fit.free_parameters import FreeParameters, free_parameter
from shake_ros.fit.least_squares import Fit, fit
from shake_ros.measured import models
from shake_ros.measured.harmonics import HarmonicProblem, HarmonicRun
from shake_ros.measured.models import left_out, predicted
from shake_ros.settings import load_table

TABLE = load_table("bergamo")
TRUTH = TABLE.with_values({"bulk_modulus.modulus": 6.0e8, "valve.flow_coefficient": 2.0e-7})
COMMANDS = ((0.3, 10.0), (0.1, 8.0), (0.2, 5.0))
ORDERS = (1, 3)
FREE = FreeParameters(
    TABLE,
    [
        free_parameter("bulk_modulus.modulus", {"scale": 1e8}, "here"),
        free_parameter("valve.flow_coefficient", {"scale": 1e-8}, "here"),
    ],
)


def runs(distorted: int | None = None) -> HarmonicProblem:
    """Runs of the true table; the amplitudes of one of them doubled."""
    blank = HarmonicProblem([HarmonicRun(a, f, dict.fromkeys(ORDERS, 1.0)) for a, f in COMMANDS])
    made = blank.simulated(TRUTH.vector()[None, :])[0]
    return HarmonicProblem(
        [
            HarmonicRun(a, f, dict(zip(ORDERS, (made[span] * (2.0 if i == distorted else 1.0)).tolist(), strict=True)))
            for i, ((a, f), span) in enumerate(zip(COMMANDS, blank.spans, strict=True))
        ]
    )


@pytest.fixture(autouse=True)
def few_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(models, "NEIGHBOURS", 1)


def solution(problem: HarmonicProblem) -> Fit:
    return fit(problem, FREE, FREE.start(), evaluations=30)


def test_runs_of_the_model_itself_are_predicted_from_the_others() -> None:
    problem = runs()
    result = left_out(problem, solution(problem))
    assert result.amplitudes == pytest.approx(problem.measured, rel=0.02)
    assert result.rms == pytest.approx(np.sqrt(np.mean((result.amplitudes - problem.measured) ** 2)))


def test_prediction_of_a_run_does_not_follow_what_was_measured_in_it() -> None:
    problem = runs(distorted=1)
    truth = runs().measured[problem.spans[1]]
    assert predicted(problem, solution(problem), 1) == pytest.approx(truth, rel=0.02)


def test_error_of_a_wrong_run_stands_at_that_run() -> None:
    problem = runs(distorted=1)
    result = left_out(problem, solution(problem))
    assert result.run_rms[1] == pytest.approx(
        np.sqrt(np.mean((0.5 * problem.measured[problem.spans[1]]) ** 2)), rel=0.05
    )
