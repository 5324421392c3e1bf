"""A late parameter is freed where it explains much of what is left above the noise, and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.search.declared_fit import with_late_parameters
from shake_ros.search.problem import ScoredFit, SearchProblem
from shake_ros.settings import load_search, load_table

TABLE = load_table("bergamo")
VISCOUS = FreeParameter("friction.viscous", 1.0, 0.0, 10.0, "N*s/m")
PASSAGE = FreeParameter("friction.transition_velocity", 1e-4, 1e-4, 1e-2, "m/s")
COLUMNS = [list(TABLE.fields).index(p.name) for p in (VISCOUS, PASSAGE)]
TRUE_PASSAGE = 5e-4
RNG = np.random.default_rng(5)
NOISE, REGRESSOR, PASSING, STRANGE = RNG.standard_normal((4, 2000))


class Linear:
    """Residuals linear in both parameters, with white noise of variance 1 and a part that neither explains."""

    def __init__(self, passing: float, strange: float, true_passage: float = TRUE_PASSAGE) -> None:
        self.passing, self.strange, self.true_passage = passing, strange, true_passage

    def centred(self, vector: np.ndarray) -> np.ndarray:
        return vector

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        viscous, passage = vectors[:, COLUMNS].T
        off = passage / self.true_passage - 1.0
        rest = NOISE + self.strange * STRANGE
        return rest + np.outer(viscous - 3.0, REGRESSOR) + np.outer(off, self.passing * PASSING)

    def blocks(self) -> np.ndarray:
        return np.arange(len(NOISE)) // 100

    def samples_for_one(self, residuals: np.ndarray) -> float:
        """Of white noise."""
        return 1.0

    def noise_cost(self) -> float:
        return 1.0


def problem_of(estimation: Any, validation: Any) -> SearchProblem:
    return SearchProblem(estimation, validation, estimation, (PASSAGE,), load_search(), lambda text, part: None)


def freed(estimation: Any, validation: Any = None) -> ScoredFit:
    problem = problem_of(estimation, validation or estimation)
    free = FreeParameters(TABLE, [VISCOUS])
    declared = fit(estimation, free, free.start(), evaluations=20, tolerance=1e-9)
    return with_late_parameters(problem, problem.scored(declared))


def test_it_is_freed_where_it_explains_what_is_left() -> None:
    result = freed(Linear(passing=1.0, strange=0.2)).fit
    assert result.free.names == (VISCOUS.name, PASSAGE.name)
    assert result.table.value(PASSAGE.name) == pytest.approx(TRUE_PASSAGE, rel=0.05)


def test_it_stays_where_something_else_is_missing() -> None:
    assert freed(Linear(passing=1.0, strange=5.0)).fit.free.names == (VISCOUS.name,)


def test_it_stays_where_nothing_is_left() -> None:
    assert freed(Linear(passing=0.02, strange=0.0)).fit.free.names == (VISCOUS.name,)


def test_it_stays_where_validation_data_speak_against_it() -> None:
    estimation, other = Linear(passing=1.0, strange=0.2), Linear(passing=3.0, strange=0.2, true_passage=1e-3)
    assert freed(estimation, other).fit.free.names == (VISCOUS.name,)


def test_it_is_freed_once() -> None:
    estimation = Linear(passing=1.0, strange=0.2)
    once = freed(estimation)
    assert with_late_parameters(problem_of(estimation, estimation), once) is once
