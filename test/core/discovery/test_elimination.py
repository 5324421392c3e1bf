"""Effects that a later one has made needless are taken out again, on residuals linear in their strengths."""

from __future__ import annotations

import pytest
from linear_effects import FIRST, SECOND, TABLE, VISCOUS, Hidden, fitted, problem_of, step

from shake_ros.core.discovery.elimination import eliminate, in_its_place, without
from shake_ros.core.discovery.problem import ScoredFit


def eliminated(first: float, second: float) -> tuple[list[str], ScoredFit, tuple[str, ...]]:
    problem = problem_of(Hidden(first, second))
    steps = (step(problem, FIRST), step(problem, FIRST, SECOND))
    kept, final, removed = eliminate(problem, steps, steps[-1].chosen.result)
    return [s.chosen.candidate.effect for s in kept], final, removed


def test_an_effect_that_the_last_one_has_made_needless_is_taken_out() -> None:
    kept, final, removed = eliminated(first=0.0, second=2.0)
    assert (kept, removed) == ([SECOND.effect], (FIRST.effect,))
    assert final.fit.free.names == (VISCOUS.name, SECOND.strength.name)
    assert final.estimation_cost == pytest.approx(0.01, rel=0.1)


def test_effects_that_are_both_needed_stay() -> None:
    kept, final, removed = eliminated(first=1.0, second=2.0)
    assert (kept, removed) == ([FIRST.effect, SECOND.effect], ())
    assert len(final.fit.x) == 3


def test_the_last_effect_is_not_asked_again() -> None:
    kept, _, removed = eliminated(first=1.0, second=0.0)
    assert (kept, removed) == ([FIRST.effect, SECOND.effect], ())


def test_an_effect_that_took_the_place_of_another_can_be_taken_out_in_turn() -> None:
    problem = problem_of(Hidden(0.0, 2.0))
    there = TABLE.with_values({SECOND.strength.name: SECOND.strength.scale})
    exchanged = in_its_place(problem, fitted(problem, FIRST), step(problem, FIRST), SECOND, there)
    assert exchanged.fit.x[-1] == pytest.approx(2.0, rel=0.01)
    bare = without(problem, exchanged, SECOND)
    assert bare.estimation_cost == pytest.approx(fitted(problem).estimation_cost)
    assert bare.fit.table.value(SECOND.strength.name) == 0.0
