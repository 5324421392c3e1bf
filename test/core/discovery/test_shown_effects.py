"""Effects that show without a search: in the model from the start, and kept only where it is better with them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from closed_loops import DEAD_BAND, declared_fit, problem_of, recording
from linear_effects import FIRST, SECOND, Hidden, fitted
from linear_effects import problem_of as linear_problem

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.decision import ForwardStep
from shake_ros.core.discovery.elimination import without
from shake_ros.core.discovery.problem import ModelStructure, Progress, SearchProblem, Stopped
from shake_ros.core.discovery.shown_effects import needed_least, shown_steps
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.settings import load_table

EFFECT, WIDTH = "spool_deadband", "effects.spool_deadband.width"


def shown(case: str, progress: Progress | None = None) -> tuple[SearchProblem, tuple[ForwardStep, ...]]:
    """Steps where a dead band seems to show on a case's table."""
    declared, learn = declared_fit(case)
    problem = problem_of(learn.records, [recording(case, 2, "hold")])
    problem = problem if progress is None else replace(problem, progress=progress)
    table = load_table("bergamo")
    pool = tuple(c for c in effect_candidates() if c.effect == EFFECT)
    model = ModelStructure(
        table,
        tuple(free_parameters()),
        candidates=pool,
        fitted=table.with_values({WIDTH: 0.5 * DEAD_BAND}),
        shown=(EFFECT,),
    )
    return problem, shown_steps(problem, model, problem.scored(declared))


def test_what_shows_and_is_there_becomes_a_step_that_can_be_taken_out() -> None:
    problem, (step,) = shown("spool_deadband")
    fit = step.chosen.result.fit
    assert step.chosen.candidate.effect == EFFECT
    assert fit.table.value(WIDTH) == pytest.approx(DEAD_BAND, rel=0.1)
    reduced = without(problem, step.chosen.result, step.chosen.candidate)
    assert EFFECT not in reduced.fit.table.effects
    assert reduced.validation_cost > 3.0 * step.chosen.result.validation_cost


def test_what_only_seems_to_show_is_left_out() -> None:
    assert shown("nothing")[1] == ()


@pytest.mark.parametrize(
    ("first", "second", "dropped", "refitted"), [(1.0, 5.0, FIRST, 1), (5.0, 1.0, SECOND, 1), (2.0, 2.5, FIRST, 2)]
)
def test_only_effects_that_may_be_needed_least_are_refitted_without(
    first: float, second: float, dropped: CandidateEffect, refitted: int
) -> None:
    problem = linear_problem(Hidden(first, second))
    least, reduced = needed_least(problem, fitted(problem, FIRST, SECOND), (FIRST, SECOND))
    assert least is dropped and dropped.strength.name not in reduced.fit.free.names
    assert len(problem.reduced) == refitted


def test_where_the_time_is_over_what_shows_is_fitted_and_waits_for_its_verdict() -> None:
    def over(text: str, part: float) -> None:
        raise Stopped

    (step,) = shown("nothing", over)[1]
    assert step.chosen.candidate.effect == EFFECT
    assert step.chosen.result.fit.free.names[-1] in {p.name for p in step.chosen.candidate.free}
    (step,) = shown("spool_deadband", over)[1]
    fit = step.chosen.result.fit
    assert fit.table.value(WIDTH) == pytest.approx(DEAD_BAND, rel=0.1)
