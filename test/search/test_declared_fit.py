"""The declared fit."""

from __future__ import annotations

from closed_loops import LEAN, recording

from shake_ros.declared import free_parameters
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.search.declared_fit import identify
from shake_ros.search.problem import ModelStructure
from shake_ros.settings import load_table


def test_a_model_that_was_sought_on_pieces_is_fitted_to_all_recordings_at_the_end() -> None:
    learned, table = [recording("nothing", 1, "learn", 6.0)], load_table("bergamo")
    settings = LEAN.replace(search_seconds=2.0, piece_seconds=1.0)
    free = tuple(f for f in free_parameters() if f.name == "valve.flow_coefficient")
    found = identify(ModelStructure(table, free), learned, [], settings, lambda text, part: None)
    assert len(found.fit.residuals) == RecordingProblem(learned).count
    assert found.fit.jacobian.shape == (len(found.fit.residuals), 1)
