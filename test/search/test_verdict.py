"""How sure each effect is, on residuals linear in the strengths of two effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_effects import FIRST, NOISE, SECOND, Hidden, fitted, problem_of, step

from shake_ros.fit.least_squares import within_budget
from shake_ros.search.problem import SearchProblem, linearised
from shake_ros.search.selection import Selection
from shake_ros.search.verdict import ESTABLISHED, LIKELY, EffectVerdict, with_verdicts


class Unexplained(Hidden):
    """The same with much that neither effect explains."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        return super().residuals(vectors) + 10.0 * np.roll(NOISE, 1)


def found_in(problem: SearchProblem) -> Selection:
    """A search that has added both effects."""
    steps = (step(problem, FIRST), step(problem, FIRST, SECOND))
    return Selection(fitted(problem), steps, steps[-1].chosen.result)


def verdicts(hidden: Hidden, *, late: bool = False) -> tuple[dict[str, EffectVerdict], tuple[str, ...]]:
    """How each effect stands that stays, and those that leave the model; late: the time is over."""
    problem = problem_of(hidden)
    found = found_in(problem)
    with within_budget(lambda: late):
        kept, told, dropped = with_verdicts(problem, found)
    assert [s.chosen.candidate.effect for s in kept.steps] == [s.effect for s in told]
    return {s.effect: s for s in told}, tuple(s.effect for s in dropped)


def states(hidden: Hidden, *, late: bool = False) -> tuple[dict[str, str], tuple[str, ...]]:
    """The state alone of each effect that stays, and those that leave the model."""
    told, dropped = verdicts(hidden, late=late)
    return {name: s.state for name, s in told.items()}, dropped


def test_two_effects_that_are_needed_at_the_noise_are_established() -> None:
    assert states(Hidden(1.0, 2.0)) == ({FIRST.effect: ESTABLISHED, SECOND.effect: ESTABLISHED}, ())


def test_where_the_time_is_over_nothing_is_established() -> None:
    assert states(Hidden(1.0, 2.0), late=True) == ({FIRST.effect: LIKELY, SECOND.effect: LIKELY}, ())


def test_a_verdict_without_time_says_so() -> None:
    told, _ = verdicts(Hidden(1.0, 2.0), late=True)
    assert {s.reason for s in told.values()} == {"not fully assessed: the time budget ended"}


@pytest.mark.parametrize(
    ("shown", "expected", "dropped"),
    [
        ((), {SECOND.effect: LIKELY}, (FIRST.effect,)),
        ((FIRST.effect,), {FIRST.effect: ESTABLISHED, SECOND.effect: LIKELY}, ()),
    ],
)
def test_what_shows_without_a_model_stays_however_much_is_unexplained(
    shown: tuple[str, ...], expected: dict[str, str], dropped: tuple[str, ...]
) -> None:
    problem = problem_of(Unexplained(0.5, 3.0))
    _, told, left = with_verdicts(problem, found_in(problem), shown)
    assert ({s.effect: s.state for s in told}, tuple(s.effect for s in left)) == (expected, dropped)
    assert all(s.odds > 1.0 for s in told)
    assert all(s.odds < 1.0 for s in left)


def test_what_shows_without_a_model_leaves_where_the_model_does_as_well_without_it() -> None:
    problem = problem_of(Unexplained(0.0, 3.0))
    kept, _, left = with_verdicts(problem, found_in(problem), (FIRST.effect,))
    assert (kept.removed, left) == ((FIRST.effect,), ())


def test_an_effect_owes_nothing_to_a_poor_fit_of_the_model_without_it() -> None:
    problem = problem_of(Hidden(0.0, 0.0))
    alone = step(problem, FIRST)
    stuck = fitted(problem_of(Hidden(5.0, 5.0)))  # leaves far more than it has to
    kept, told, left = with_verdicts(problem, Selection(stuck, (alone,), alone.chosen.result))
    assert (kept.removed, told, left) == ((FIRST.effect,), (), ())


def test_an_effect_is_not_lost_to_a_poor_fit_of_the_model_with_it() -> None:
    problem = problem_of(Hidden(1.0, 2.0))
    found = found_in(problem)
    poor = problem.scored(linearised(problem.estimation, replace(found.final.fit, x=found.final.fit.x + 3.0)))
    kept, told, left = with_verdicts(problem, found.on(lambda m: m, lambda _: poor))
    assert ({s.effect: s.state for s in told}, left) == ({FIRST.effect: ESTABLISHED, SECOND.effect: ESTABLISHED}, ())
    assert kept.final.fit.x == pytest.approx(found.final.fit.x, abs=1e-3)
