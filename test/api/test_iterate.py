"""`iterate`: the drive that it writes is played as it is, and runs on the simulated table miss less."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shake_ros.api.read import recording
from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.fit.records import Record
from shake_ros.iteration.iterate import Iterated, iterate, iterate_simulated
from shake_ros.iteration.table import SimulatedTable
from shake_ros.quantities import ShakeError
from shake_ros.recordings.reference_file import build_program
from shake_ros.settings import load_search, load_table

FIXED = ("model_soft_zone", "super_twisting_model")


def test_written_drive_is_the_reference_that_is_played(tmp_path: Path) -> None:
    drive = np.array(build_program("earthquake_rock", 0.001).states)
    drive = states_from_rest(1.1 * drive[:, 2], 0.001)
    out = Iterated(("run",), (0.5,), 0.001, drive).report(tmp_path / "out")
    played = build_program(str(out / "drive.yaml"), 0.001).states
    assert len(played) == len(drive)
    np.testing.assert_allclose(played[:, 2], drive[:, 2], atol=1e-3)  # of 5 m/s²
    np.testing.assert_allclose(played[:, 0], drive[:, 0], atol=2e-4)  # the mean and the ends are taken out once more


def test_simulated_runs_are_reported_and_all_files_are_written(tmp_path: Path) -> None:
    told: list[str] = []
    table = SimulatedTable(progress=lambda text, part: told.append(text))
    found = iterate_simulated("earthquake_rock", table, runs=2)
    assert max(found.missed) < 0.05
    assert found.wrong == ""
    assert [text.split(":")[0] for text in told] == ["run 1", "run 2"]
    assert found.error["run"] == ("run 1", "run 2")
    out = found.report(tmp_path / "out")
    files = {"drive.csv", "drive.yaml", "iteration.json", "model.yaml", "report.html"}
    assert {p.name for p in out.iterdir()} == files


def test_recording_without_reference_is_refused_by_topic() -> None:
    time = np.arange(200) / 100
    run = recording("bare", time, 0 * time, np.sin(time), acceleration=-np.sin(time))
    with pytest.raises(ShakeError, match="bare: no topic reference"):
        iterate("earthquake_rock", run)


def test_model_that_lacks_the_soft_zone_is_reported_from_the_runs() -> None:
    table = SimulatedTable("bergamo", *FIXED, progress=False, changes={"effects.soft_zone.depth": 0.84})
    found = iterate_simulated("earthquake_rock", table, runs=2)
    assert found.wrong
    part = slice(2000, 5000)
    runs = [
        Record(r.name, r.sample_time, r.commands[part], r.position[part], r.acceleration[part])
        for r in found.records
        if r.acceleration is not None
    ]
    short = replace(load_search(), converging_evaluations=10)
    told = replace(found, records=tuple(runs)).lacking(short, progress=False)
    assert told.startswith("close_loop on the runs: the model lacks soft_zone (compressibility")
    assert "--refit soft_zone" in told
    assert "needs two" in replace(found, records=tuple(runs[:1])).lacking(short)


@pytest.mark.parametrize("load", [0.0, 500.0])
def test_a_model_that_knows_neither_load_nor_delay_converges_and_is_better_once_fitted(load: float) -> None:
    table = SimulatedTable("bergamo", *FIXED, delay=1, progress=False, changes={"specimen_mass": load})
    found = iterate_simulated("earthquake_soft_soil", table, runs=2, refit=["command_delay"])
    assert found.wrong == ""
    assert found.missed[0] < 0.08
    assert found.missed[1] < 0.9 * found.missed[0]


def test_a_table_with_a_soft_zone_and_another_load_converges_by_the_defaults() -> None:
    # under the gains of the table bergamo it rings: 240 % of the acceleration missed even with 200 kg
    table = SimulatedTable("bergamo_table_6_9", delay=1, progress=False, changes={"specimen_mass": 500.0})
    found = iterate_simulated("earthquake_rock", table, runs=2)
    assert found.wrong == ""
    assert found.missed[1] < 0.05 < 0.2 < found.missed[0]
    assert found.model is not None
    assert found.model.value("body.specimen_mass") == pytest.approx(500.0, abs=10.0)


def test_own_gains_go_for_both_or_none() -> None:
    with pytest.raises(ShakeError, match="'own' goes for both or none"):
        SimulatedTable(controller="super_twisting_model").loop(load_table("bergamo"))
