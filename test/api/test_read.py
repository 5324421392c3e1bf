"""What verbs take for recordings: paths, recordings, several of either; and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.api.read import recordings
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import write_table_recording

TIME = np.arange(2000) / 1000
COMMAND, POSITION = 0.05 * np.sin(9.0 * TIME), -0.01 * np.cos(9.0 * TIME)


def run(name: str) -> sr.Recordings:
    return sr.recording(name, TIME, COMMAND, POSITION)


def test_paths_recordings_and_several_of_either_are_taken(tmp_path: Path) -> None:
    path = write_table_recording(tmp_path / "written", TIME, COMMAND, POSITION)
    assert recordings([path, run("one")]).names == ("written", "one")
    assert recordings(str(tmp_path)).names == ("written",)
    assert recordings([run("one"), [run("two")[0]]]).names == ("one", "two")
    assert recordings(run("one")[0]).names == ("one",)
    assert recordings(None).names == ()


@pytest.mark.parametrize("given", [5, COMMAND, [run]], ids=["number", "array", "function"])
def test_what_is_no_recording_is_refused(given: Any) -> None:
    with pytest.raises(ShakeError, match="is not a recording"):
        sr.identify(sr.model("full"), given, progress=False)


def test_missing_path_is_named() -> None:
    with pytest.raises(ShakeError, match="nowhere: no such recording"):
        sr.close_loop(sr.model("full"), "nowhere", run("other"), progress=False)


def test_an_array_of_another_length_is_refused_by_the_recordings_name() -> None:
    with pytest.raises(ShakeError, match=r"^run: 'valve_command' has shape"):
        sr.recording("run", TIME, COMMAND[:-1], POSITION)
