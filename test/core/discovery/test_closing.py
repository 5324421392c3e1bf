"""Starts of the declared fit, and the models that closing the loop passes through."""

from __future__ import annotations

import numpy as np
from closed_loops import CASES, command

from shake_ros.cli import fitting
from shake_ros.core.discovery.closing import random_starts
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.settings import load_table


def test_starts_spread_within_the_bounds_and_are_the_same_every_time() -> None:
    free = FreeParameters(load_table("bergamo"), fitting.declared_parameters("full"))
    starts = random_starts(free, 20)
    assert starts.shape == (20, len(free.names))
    assert np.all(starts >= free.low) and np.all(starts <= free.high)
    assert np.array_equal(starts, random_starts(free, 20))
    assert not np.array_equal(starts, random_starts(free, 20, seed=1))
    assert np.min(np.std(starts, axis=0) / np.mean(starts, axis=0)) > 0.2


def test_closing_the_loop_ends_with_the_extended_model() -> None:
    result = command("spool_deadband").result
    assert result.final is result.models[-1]
    assert len(result.models) == len(result.search.steps) == 1
    assert result.final.hold["hold"]["acceleration"] < 0.1 * result.baseline.hold["hold"]["acceleration"]
    assert result.final.table.value("effects.spool_deadband.width") == (
        np.float64(next(p.value for p in result.final.parameters if p.name == "effects.spool_deadband.width"))
    )


def test_closing_the_loop_where_nothing_is_missing_ends_with_the_declared_model() -> None:
    result = command("nothing").result
    assert CASES["nothing"] == {}
    assert result.models == ()
    assert result.final is result.baseline
    assert not result.remaining.above_noise
