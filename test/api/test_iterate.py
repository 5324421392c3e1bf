"""`iterate`: the drive that it writes is played as it is, and runs on the simulated table miss less."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shake_ros.api.iterate import iterate, iterate_simulated
from shake_ros.api.iterated import Iterated
from shake_ros.api.read import recording
from shake_ros.api.simulated_table import SimulatedTable
from shake_ros.core.iteration.drive import integrate
from shake_ros.core.quantities import ShakeError
from shake_ros.data.reference_program import build_program


def test_written_drive_is_the_reference_that_is_played(tmp_path: Path) -> None:
    drive = np.array(build_program("earthquake_rock", 0.001).states)
    drive = integrate(1.1 * drive[:, 2], 0.001)
    out = Iterated(("run",), (0.5,), 0.001, drive).report(tmp_path / "out")
    played = build_program(str(out / "drive.yaml"), 0.001).states
    assert len(played) == len(drive)
    np.testing.assert_allclose(played[:, 2], drive[:, 2], atol=1e-3)  # of 5 m/s²
    np.testing.assert_allclose(played[:, 0], drive[:, 0], atol=2e-4)  # the mean and the ends are taken out once more


def test_second_simulated_run_misses_less_and_all_files_are_written(tmp_path: Path) -> None:
    told: list[str] = []
    table = SimulatedTable(progress=lambda text, part: told.append(text))
    found = iterate_simulated("earthquake_rock", table, runs=2)
    assert found.missed[1] < found.missed[0]
    assert [text.split(":")[0] for text in told] == ["run 1", "run 2"]
    assert found.error["run"] == ("run 1", "run 2")
    out = found.report(tmp_path / "out")
    assert {p.name for p in out.iterdir()} == {"drive.csv", "drive.yaml", "iteration.json", "report.html"}


def test_recording_without_reference_is_refused_by_topic() -> None:
    time = np.arange(200) / 100
    run = recording("bare", time, 0 * time, np.sin(time), acceleration=-np.sin(time))
    with pytest.raises(ShakeError, match="bare: no topic reference"):
        iterate("earthquake_rock", run)
