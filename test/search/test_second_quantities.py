"""Functions of two quantities: found in a table that the package did not simulate, and not where one quantity suffices.

The tables are those of benchmarks/discovery/hidden_tables.py, with solver, friction near rest and sensors of its own.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.discovery import confusion, two_quantities
from shake_ros.declared import model_structure
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.physics.effects import unlisted as law
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.search.closed_form import fitted_changes, learnt_function
from shake_ros.search.decision import ForwardStep
from shake_ros.search.problem import ScoredFit, SearchProblem
from shake_ros.search.second_quantities import function_of_two, with_second_quantity
from shake_ros.search.unlisted_functions import FunctionSearch, best_function
from shake_ros.settings import load_search, load_table

SAID: list[str] = []


def posed(case: str, length: float) -> tuple[SearchProblem, ScoredFit]:
    """Recordings of a table, and the fit of the declared model to them."""
    records = two_quantities.recordings(case, 0, length)
    learn, hold = (confusion.fitted_parts(records, kind) for kind in ("learn", "hold"))
    settings = replace(load_search(), most_refitted=1)
    model = model_structure(load_table("bergamo"))
    problem = SearchProblem.of(model, learn, hold, settings, lambda text, _: SAID.append(text))
    free = FreeParameters(model.table, model.free)
    return problem, problem.fitted(free, free.start(), 30, 1e-4)


def residual_to_noise_ratio(problem: SearchProblem, fit: ScoredFit) -> float:
    """Held-out error over the noise."""
    return float(np.sqrt(fit.validation_cost / problem.validation.noise_cost()))


@pytest.fixture(scope="module")
def found() -> tuple[SearchProblem, ScoredFit, ForwardStep]:
    problem, current = posed("flow gain of opening and load pressure", 0.5)
    step = function_of_two(problem, current, FunctionSearch({}, None))
    assert step is not None
    return problem, current, step


def test_place_and_both_quantities_are_named_and_the_held_out_error_comes_near_the_noise(
    found: tuple[SearchProblem, ScoredFit, ForwardStep],
) -> None:
    problem, current, step = found
    chosen = step.chosen
    before, after = residual_to_noise_ratio(problem, current), residual_to_noise_ratio(problem, chosen.result)
    print(f"held-out error over the noise: {before:.2f} declared, {after:.2f} with a function of two quantities")
    assert chosen.candidate.place == "valve"
    assert chosen.candidate.depends_on == ("valve_opening", "load_pressure")
    assert before > 1.5
    assert after < 1.2
    assert any("valve_opening and load_pressure" in text for text in SAID)
    assert any("depends on valve opening and load pressure" in text for text in SAID)


def test_its_table_is_one_like_any_other(found: tuple[SearchProblem, ScoredFit, ForwardStep]) -> None:
    table = found[2].chosen.result.fit.table
    again = FULL_LAYOUT.table(table.to_mapping(), "table.yaml")
    np.testing.assert_array_equal(again.vector(), table.vector())
    assert again.value("effects.unlisted.second") == law.LOAD_PRESSURE


def test_the_learnt_change_has_nodes_with_standard_errors_and_a_closed_form(
    found: tuple[SearchProblem, ScoredFit, ForwardStep],
) -> None:
    problem, _, step = found
    function = learnt_function(problem, step.chosen.result)
    assert function is not None and function.second is not None
    second = function.second
    assert (second.quantity, second.unit) == ("load_pressure", "Pa")
    for values, deviations in ((second.above, second.above_deviations), (second.below, second.below_deviations)):
        assert values.shape == deviations.shape == (law.CHANGES,)
        assert np.count_nonzero(np.isfinite(deviations)) > law.CHANGES // 2
    assert second.form.name in ("separable", "sum")
    assert second.form.cost > 0.9


def test_nothing_of_two_quantities_is_offered_where_one_suffices() -> None:
    problem, current = posed("push at one place", 0.5)
    best = best_function(problem, current).best
    assert best is not None
    one = ForwardStep(best, (best,))
    assert best.candidate.depends_on == ("position",)
    assert with_second_quantity(problem, one) is one


def test_model_without_a_place_for_functions_is_offered_none() -> None:
    reduced: Any = SimpleNamespace(fit=SimpleNamespace(free=SimpleNamespace(base=SimpleNamespace(fields={}))))
    problem: Any = SimpleNamespace(settings=load_search())
    assert best_function(problem, reduced) == FunctionSearch({}, None)
    assert function_of_two(problem, reduced, FunctionSearch({}, None)) is None


def test_a_change_by_the_same_everywhere_is_a_sum_and_one_in_proportion_is_separable() -> None:
    f = np.array([0.0, 10.0, 40.0, 90.0, 40.0, 10.0, 0.0, 0.0])
    noise = np.random.default_rng(0).normal(0.0, 1.0, (2, 8))
    proportion = fitted_changes(f, np.array([0.5 * f, -0.3 * f]) + noise, np.ones((2, 8)))[0]
    assert proportion.name == "separable"
    assert proportion.parameters["c⁺"] == pytest.approx(0.5, abs=0.05)
    assert proportion.parameters["c⁻"] == pytest.approx(-0.3, abs=0.05)
    same = fitted_changes(f, np.array([20.0 + 0.0 * f, 0.0 * f]) + noise, np.ones((2, 8)))[0]
    assert same.name == "sum"
    assert same.parameters["c⁺"] == pytest.approx(20.0, abs=1.5)
