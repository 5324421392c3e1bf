"""Effects that are taken out again or exchanged, on residuals linear in their strengths."""

from __future__ import annotations

import pytest
from linear_effects import FIRST, SECOND, TABLE, Hidden, fitted, problem_of, step

from shake_ros.search.elimination import in_its_place, without


def test_an_effect_that_took_the_place_of_another_can_be_taken_out_in_turn() -> None:
    problem = problem_of(Hidden(0.0, 2.0))
    there = TABLE.with_values({SECOND.strength.name: SECOND.strength.scale})
    exchanged = in_its_place(problem, fitted(problem, FIRST), step(problem, FIRST), SECOND, there)
    assert exchanged.fit.x[-1] == pytest.approx(2.0, rel=0.01)
    bare = without(problem, exchanged, SECOND)
    assert bare.estimation_cost == pytest.approx(fitted(problem).estimation_cost)
    assert bare.fit.table.value(SECOND.strength.name) == 0.0
