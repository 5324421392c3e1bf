"""A search uses predictor runs beside the free ones only where equal commands show process noise."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.declared import model_structure
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit, fit
from shake_ros.fit.records import Record
from shake_ros.fit.start.narrow_valleys import INJECTION
from shake_ros.repair.close_loop import beside_process_noise
from shake_ros.search.problem import SearchProblem
from shake_ros.search.selection import Selection
from shake_ros.settings import load_search, load_table

STRUCTURE = model_structure(load_table("bergamo"))


def search(force: float) -> tuple[SearchProblem, Fit]:
    """A search over two recordings of a table with process noise, and the true model."""
    truth = hidden.declared_truth(3)._replace(rumble=force)
    made = {
        name: hidden.record(truth, hidden.excitations(3)[name], 1.0, np.random.default_rng(3))
        for name in ("learn_multisine", "hold_multisine")
    }
    records = [Record(n, hidden.SAMPLE, m["command"], m["position"], m["acceleration"]) for n, m in made.items()]
    problem = SearchProblem.of(STRUCTURE, records[:1], records[1:], load_search(), lambda *_: None)
    free = FreeParameters(STRUCTURE.table, STRUCTURE.free)
    start = free.x_of({name: getattr(truth, field) for name, field in hidden.DECLARED.items()})
    return problem, fit(problem.estimation, free, start, evaluations=1, tolerance=1e-2)


@pytest.fixture(scope="module")
def rumbling() -> tuple[SearchProblem, Fit]:
    return search(120.0)


def test_without_process_noise_a_search_stays_as_it_is() -> None:
    problem, true = search(0.0)
    current = problem.scored(true)
    assert problem.with_predictor(true) is problem
    assert problem.refitted(current) is current
    found = Selection(current, (), current)
    assert beside_process_noise(problem, found) == (problem, found)


def test_process_noise_counts_as_noise(rumbling: tuple[SearchProblem, Fit]) -> None:
    problem, true = rumbling
    corrected = problem.with_predictor(true)
    assert corrected.predictor_rate == INJECTION
    assert corrected.validation.noise_cost() > 4.0 * problem.validation.noise_cost()


def test_verdicts_rest_on_predictor_runs_which_process_noise_moves_less(rumbling: tuple[SearchProblem, Fit]) -> None:
    problem, true = rumbling
    corrected = problem.with_predictor(true)
    judge = corrected.on_predictor_runs(true)
    noise = judge.validation.noise_cost()
    assert noise < 0.5 * corrected.validation.noise_cost()
    assert judge.scored(true).validation_cost == pytest.approx(noise, rel=0.5)
    assert corrected.again(judge.again(corrected.scored(true))).score == pytest.approx(corrected.scored(true).score)
    assert problem.on_predictor_runs(true) is problem


def test_a_fit_to_both_lowers_the_error_of_predictor_runs(rumbling: tuple[SearchProblem, Fit]) -> None:
    problem, true = rumbling
    corrected = problem.with_predictor(true)
    alone = corrected.fitted(true.free, true.x, 10, 1e-4, near=True)
    both = corrected.refitted(alone)
    predictor = corrected.estimation.predictor(INJECTION)
    left = [float(np.mean(predictor.residuals(m.fit.vector[None, :]) ** 2)) for m in (alone, both)]
    assert left[1] < left[0]
    assert len(both.fit.residuals) == corrected.estimation.count


def test_nothing_to_add_leaves_the_models_as_free_runs_have_found_them(rumbling: tuple[SearchProblem, Fit]) -> None:
    problem, true = rumbling
    current = problem.scored(true)
    corrected, found = beside_process_noise(problem, Selection(current, (), current))
    assert corrected.predictor_rate == INJECTION
    assert found.steps == ()
    assert found.final.fit is true
