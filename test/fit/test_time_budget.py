"""A fit whose time budget is over ends at the best that it has met, in the context of that budget alone."""

from __future__ import annotations

from itertools import count
from threading import Thread

import numpy as np
import pytest

from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import Fit, fit, never, time_is_over, within_budget
from shake_ros.search.problem import side_by_side
from shake_ros.settings import load_table

TABLE = load_table("bergamo")
FREE = FreeParameters(TABLE, [FreeParameter("friction.viscous", 100.0, 0.0, 1e5, "N*s/m")])


class Valley:
    """Residuals of one parameter with a narrow way down to 50 scales."""

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        x = vectors[:, list(TABLE.fields).index("friction.viscous")] / 100.0
        return np.column_stack([np.exp(0.2 * (x - 50.0)) - 1.0, 0.1 * (x - 50.0)])


def fitted() -> Fit:
    return fit(Valley(), FREE, np.array([4.0]), tolerance=1e-10)


def test_a_fit_whose_time_is_over_ends_at_the_best_that_it_has_met() -> None:
    whole = fitted()
    assert whole.x[0] == pytest.approx(50.0, abs=1e-3)
    asked = count()
    with within_budget(lambda: next(asked) >= 2):
        cut = fitted()
    assert cut.evaluations < whole.evaluations
    assert whole.cost < cut.cost < 0.5 * float(np.sum(Valley().residuals(FREE.vectors(np.array([4.0]))) ** 2))
    assert cut.residuals == pytest.approx(Valley().residuals(FREE.vectors(cut.x))[0])


def test_a_fit_that_has_just_begun_still_takes_one_jacobian() -> None:
    with within_budget(lambda: True):
        found = fitted()
    assert found.x[0] == pytest.approx(4.0)
    assert found.jacobian.shape == (2, 1) and np.all(found.jacobian != 0.0)


def test_a_time_budget_belongs_to_a_context_and_holds_for_what_is_done_side_by_side() -> None:
    elsewhere = list[bool]()
    with within_budget(lambda: True):
        assert list(side_by_side(lambda _: time_is_over(), range(4))) == [True] * 4
        thread = Thread(target=lambda: elsewhere.append(time_is_over()))
        thread.start()
        thread.join()
        with within_budget(never):
            assert not time_is_over()
    assert elsewhere == [False] and not time_is_over()
