"""Effects that a later one has made needless are taken out again, on residuals linear in their strengths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.decision import ForwardStep
from shake_ros.core.discovery.elimination import eliminate
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem
from shake_ros.core.discovery.refit import Refit
from shake_ros.core.identification.fit import fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.settings import load_search, load_table

TABLE = load_table("bergamo")
POOL = {c.effect: c for c in effect_candidates()}
FIRST, SECOND = POOL["constant_force"], POOL["asymmetric_flow_gain"]
VISCOUS = next(p for p in free_parameters() if p.name == "friction.viscous")
PARAMETERS = (VISCOUS, FIRST.strength, SECOND.strength)
COLUMNS = [list(TABLE.fields).index(p.name) for p in PARAMETERS]
NOISE, *DIRECTIONS = np.random.default_rng(11).standard_normal((4, 2000))


class Hidden:
    """Residuals linear in three parameters, of which the true table has the strengths given, in their scales."""

    def __init__(self, first: float, second: float) -> None:
        self.true = np.array([3.0, first, second])

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        x = vectors[:, COLUMNS] / [p.scale for p in PARAMETERS]
        return 0.1 * NOISE + (x - self.true) @ np.array(DIRECTIONS)

    def blocks(self) -> np.ndarray:
        return np.arange(len(NOISE)) // 100

    def drawn(self, _injection: float) -> Hidden:
        return self

    def noise_cost(self) -> float:
        return 0.01


def problem_of(hidden: Any) -> SearchProblem:
    return SearchProblem(hidden, hidden, hidden, hidden, (), load_search(), lambda text, part: None)


def step(problem: SearchProblem, *effects: CandidateEffect) -> ForwardStep:
    """A step that ended with these effects."""
    free = FreeParameters(TABLE, [VISCOUS, *(e.strength for e in effects)])
    result = fit(problem.estimation, free, free.start(), evaluations=30, tolerance=1e-9)
    refit = Refit(effects[-1], problem.scored(result), 0.5)
    return ForwardStep(refit, (refit,))


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
