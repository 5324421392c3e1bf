"""A function without a name on a force-driven axis: when it leads, and refused where the measured force contradicts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shake_ros.declared import free_parameters, model_structure, search_settings
from shake_ros.fit.axis_model import AXIS, AxisModel
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.records import Record
from shake_ros.physics.plant.axis import AXIS_LAYOUT, initial_state, run_batch
from shake_ros.search.problem import SearchProblem
from shake_ros.search.second_quantities import screen_pairs
from shake_ros.search.unlisted_functions import best_function

DECLARED = AXIS_LAYOUT.table({"axis": {"mass": 95.0, "viscous": 200.0, "coulomb": 20.0, "offset": 0.0}}, "axis")
TRUE = DECLARED.with_values({"effects.stiffness_to_ground.stiffness": 60.0})


def recorded(name: str, frequency: float) -> Record:
    time = 1e-3 * np.arange(4000)
    force = 60.0 * np.sin(2.0 * np.pi * frequency * time)
    position = run_batch(TRUE.vector()[None, :], initial_state(0.0, 0.0), force, 1e-3)[0, :, 0]
    return Record(name, 1e-3, force, np.round(position, 7))


@pytest.fixture(scope="module")
def problem() -> SearchProblem:
    settings = replace(search_settings(AXIS), most_refitted=1, continued_evaluations=8)
    structure = model_structure(DECLARED, AXIS)
    return SearchProblem.of(structure, [recorded("a", 0.7)], [recorded("b", 1.1)], settings, lambda *_: None)


def test_a_function_that_the_force_confirms_is_offered_and_one_that_it_contradicts_is_not(
    problem: SearchProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = FreeParameters(DECLARED, list(free_parameters(AXIS)))
    current = problem.scored(fit(problem.estimation, free, free.start(), evaluations=20))
    found = best_function(problem, current).best
    assert found is not None
    assert found.candidate.depends_on == ("position",)
    assert found.result.validation_cost < 0.3 * current.validation_cost
    monkeypatch.setattr(AxisModel, "contradicted", lambda *_: True)
    assert best_function(problem, current).best is None


def test_an_axis_has_functions_of_two_quantities_that_it_knows(problem: SearchProblem) -> None:
    free = FreeParameters(DECLARED, list(free_parameters(AXIS)))
    current = problem.scored(fit(problem.estimation, free, free.start(), evaluations=20))
    pairs = {(pair.function.kind.code, pair.quantity) for pair in screen_pairs(problem, current.fit)}
    of_position = {(kind, quantity) for kind in (1, 2) for quantity in ("velocity", "time")}
    assert pairs == of_position | {(3, "position"), (3, "time")}
