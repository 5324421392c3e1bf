"""Starts of the declared fit."""

from __future__ import annotations

import numpy as np
from closed_loops import LEAN, recording

from shake_ros.core.discovery.declared_fit import identify, random_starts
from shake_ros.core.discovery.problem import ModelStructure
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.core.identification.recording_problem import RecordingProblem
from shake_ros.declared import free_parameters
from shake_ros.settings import load_table


def test_starts_spread_within_the_bounds_and_are_the_same_every_time() -> None:
    free = FreeParameters(load_table("bergamo"), free_parameters())
    starts = random_starts(free, 20, 4.0)
    assert starts.shape == (20, len(free.names))
    assert np.array_equal(starts[0], free.start())
    assert np.all(starts >= free.low) and np.all(starts <= free.high)
    assert np.array_equal(starts, random_starts(free, 20, 4.0))
    assert not np.array_equal(starts, random_starts(free, 20, 4.0, seed=1))
    assert np.min(np.std(starts, axis=0) / np.mean(starts, axis=0)) > 0.2


def test_a_model_that_was_sought_on_pieces_is_fitted_to_all_recordings_at_the_end() -> None:
    learned, table = [recording("nothing", 1, "learn", 6.0)], load_table("bergamo")
    settings = LEAN.replace(search_seconds=2.0, search_piece=1.0, starts=1, fitted_starts=0)
    free = tuple(f for f in free_parameters() if f.name == "valve.flow_coefficient")
    found = identify(ModelStructure(table, free), learned, [], settings, lambda text, part: None)
    assert len(found.fit.residuals) == RecordingProblem(learned).count
    assert found.fit.jacobian.shape == (len(found.fit.residuals), 1)
