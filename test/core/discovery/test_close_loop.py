"""The models that closing the loop passes through."""

from __future__ import annotations

import numpy as np
from closed_loops import CASES, command


def test_closing_the_loop_ends_with_the_extended_model() -> None:
    result = command("spool_deadband").result
    assert result.final is result.models[-1]
    assert len(result.models) == len(result.search.steps) == 1
    assert result.final.validation["hold"]["acceleration"] < 0.1 * result.baseline.validation["hold"]["acceleration"]
    assert result.final.table.value("effects.spool_deadband.width") == (
        np.float64(next(p.value for p in result.final.parameters if p.name == "effects.spool_deadband.width"))
    )


def test_closing_the_loop_where_nothing_is_missing_ends_with_the_declared_model() -> None:
    result = command("nothing").result
    assert CASES["nothing"] == {}
    assert result.models == ()
    assert result.final is result.baseline
    assert not result.remaining.above_noise
