"""A late parameter is freed where it explains much of what is left above the noise, and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shake_ros.core.discovery.judging import Policy
from shake_ros.core.discovery.late import freed_late
from shake_ros.core.identification.fit import Fit, fit
from shake_ros.core.identification.free_parameters import FreeParameter, FreeParameters
from shake_ros.settings import load_table

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

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        viscous, passage = vectors[:, COLUMNS].T
        off = passage / self.true_passage - 1.0
        rest = NOISE + self.strange * STRANGE
        return rest + np.outer(viscous - 3.0, REGRESSOR) + np.outer(off, self.passing * PASSING)

    def noise_cost(self) -> float:
        return 1.0


def declared(problem: Any) -> Fit:
    free = FreeParameters(TABLE, [VISCOUS])
    return fit(problem, free, free.start(), evaluations=20, tolerance=1e-9)


def freed(problem: Any, hold: Any = None) -> Fit:
    return freed_late(problem, hold, declared(problem), [PASSAGE], Policy())


def test_it_is_freed_where_it_explains_what_is_left() -> None:
    problem = Linear(passing=1.0, strange=0.2)
    result = freed(problem, problem)
    assert result.free.names == (VISCOUS.name, PASSAGE.name)
    assert result.free.table(result.x).value(PASSAGE.name) == pytest.approx(TRUE_PASSAGE, rel=0.05)


def test_it_stays_where_something_else_is_missing() -> None:
    assert freed(Linear(passing=1.0, strange=5.0)).free.names == (VISCOUS.name,)


def test_it_stays_where_nothing_is_left() -> None:
    assert freed(Linear(passing=0.02, strange=0.0)).free.names == (VISCOUS.name,)


def test_it_stays_where_the_recordings_held_out_speak_against_it() -> None:
    problem, other = Linear(passing=1.0, strange=0.2), Linear(passing=3.0, strange=0.2, true_passage=1e-3)
    assert freed(problem, other).free.names == (VISCOUS.name,)


def test_it_is_freed_once() -> None:
    problem: Any = Linear(passing=1.0, strange=0.2)
    once = freed(problem)
    assert freed_late(problem, None, once, [PASSAGE], Policy()) is once
