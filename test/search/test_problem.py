"""How a fit scores on estimation and validation data."""

from __future__ import annotations

import numpy as np
import pytest
from closed_loops import named

from shake_ros.search.problem import linearised, mean_square


def test_the_same_solution_on_validation_data_has_their_residuals() -> None:
    found = named("nothing")
    declared = found.search.declared
    moved = linearised(found.problem.validation, declared.fit)
    assert np.array_equal(moved.x, declared.fit.x)
    assert mean_square(moved.residuals) == found.problem.scored(declared.fit).validation_cost
    assert moved.cost == pytest.approx(0.5 * mean_square(moved.residuals) * len(moved.residuals))


def test_blocks_of_the_validation_cost_average_to_it() -> None:
    found = named("nothing")
    scored = found.problem.scored(found.search.declared.fit)
    count = len(found.problem.validation.blocks())
    assert np.sum(scored.validation_blocks) / count == pytest.approx(scored.validation_cost)
