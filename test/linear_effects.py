"""A search on residuals that are linear in the strengths of two effects: what is right can be told beforehand."""

from __future__ import annotations

from typing import Any

import numpy as np

from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import ForwardStep, Refit
from shake_ros.search.problem import ScoredFit, SearchProblem
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

    def centred(self, vector: np.ndarray) -> np.ndarray:
        return vector

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        x = vectors[:, COLUMNS] / [p.scale for p in PARAMETERS]
        return NOISE + 10.0 * (x - self.true) @ np.array(DIRECTIONS)

    def blocks(self) -> np.ndarray:
        return np.arange(len(NOISE)) // 100

    def predictor(self, _injection: float) -> Hidden:
        return self

    def samples_for_one(self, residuals: np.ndarray) -> float:
        """Of white noise."""
        return 1.0

    def noise_cost(self) -> float:
        return 1.0


def problem_of(hidden: Any) -> SearchProblem:
    return SearchProblem(hidden, hidden, hidden, (), load_search(), lambda text, part: None)


def fitted(problem: SearchProblem, *effects: CandidateEffect) -> ScoredFit:
    """The fit of a model with these effects."""
    free = FreeParameters(TABLE, [VISCOUS, *(e.strength for e in effects)])
    return problem.scored(fit(problem.estimation, free, free.start(), evaluations=30, tolerance=1e-9))


def step(problem: SearchProblem, *effects: CandidateEffect) -> ForwardStep:
    """A step that ended with these effects."""
    refit = Refit(effects[-1], fitted(problem, *effects), 0.5)
    return ForwardStep(refit, (refit,))
