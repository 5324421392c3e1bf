"""Gains follow the table: what `sr.tune(table)` recommends holds on it and its neighbours, and is written with it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from short_tuning import short_tuning

import shake_ros as sr
from shake_ros.__main__ import main
from shake_ros.api.tune_table import TunedTable, findings, load_of, load_robust, read_uncertainty, tune_table
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.robust import Load
from shake_ros.control.trials import Trials
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table, load_variant

SOFT = {  # half the oil's stiffness, a soft zone, 3.4 ms of dead time
    "bulk_modulus.modulus": 5.8e8,
    "effects.soft_zone.depth": 0.6,
    "effects.soft_zone.threshold": 8e5,
    "effects.soft_zone.sharpness": 7e-6,
    "effects.command_delay.delay": 0.0034,
}


@pytest.fixture(scope="module")
def soft() -> TableParameters:
    return load_table("bergamo").with_values(SOFT)


@pytest.fixture(scope="module")
def tuned(soft: TableParameters, tmp_path_factory: pytest.TempPathFactory) -> TunedTable:
    settings = short_tuning(tmp_path_factory.mktemp("tuning"), 3)
    found = sr.tune(soft, settings=settings, laws=["sliding_mode", "three_variable"], progress=False)
    assert isinstance(found, TunedTable)
    return found


def test_loop_with_the_gains_of_a_soft_and_late_table_tracks_where_the_default_gains_ring(
    tuned: TunedTable, soft: TableParameters
) -> None:
    observer, controller = tuned.loop()
    found = sr.simulate(soft, "earthquake", controller=controller, observer=observer, delay=1, seed=5)
    fixed = sr.simulate(soft, "earthquake", controller="super_twisting_tuned", observer="model", model=soft, delay=1)
    errors, before = found.error["error"], fixed.error["error"]
    assert errors[0] < 0.005
    assert errors[1] < 0.03
    assert errors[2] < 0.15
    assert before[2] > 2.0 * errors[2]


def test_loop_of_which_only_one_part_predicts_is_refused(tuned: TunedTable, soft: TableParameters) -> None:
    _, controller = tuned.loop()
    with pytest.raises(ShakeError, match="must both predict"):
        sr.simulate(soft, "earthquake", controller=controller, observer="linear_bergamo")


def test_no_law_that_is_recommended_rings_on_a_neighbour(tuned: TunedTable) -> None:
    assert tuned.sound
    assert tuned.margins.stable
    assert tuned.margins.sensitivity < 1.75
    assert all(trial.ringing < 1.0 for trial in tuned.best.trials)


def test_files_are_read_by_path_and_carry_the_table_beside_them(tuned: TunedTable, tmp_path: Path) -> None:
    out = tuned.write(tmp_path / "gains")
    kind, parameters = load_variant("controller", str(out / "controller.yaml"), CONTROLLERS)
    seer, own = load_variant("observer", str(out / "observer.yaml"), OBSERVERS)
    assert kind == tuned.best.kind
    assert parameters.model == str(out / "table.yaml")
    assert dataclasses.replace(parameters, model="table.yaml") == tuned.best.parameters
    assert seer == "model" and dataclasses.replace(own, model="table.yaml") == tuned.observer
    assert load_table(parameters.model).to_mapping() == tuned.table.to_mapping()
    assert "disk" in (out / "controller.yaml").read_text(encoding="utf-8")
    assert json.loads((out / "tune.json").read_text(encoding="utf-8"))["sound"] is True
    with pytest.raises(ShakeError, match="exists already"):
        tuned.write(out)


def test_gains_that_ring_are_not_written_without_force(tuned: TunedTable, tmp_path: Path) -> None:
    rings = dataclasses.replace(tuned.best, rings=1.4)
    unsound = dataclasses.replace(tuned, laws=(rings,), findings=("oscillates on neighbour 2",))
    with pytest.raises(ShakeError, match="not written: oscillates on neighbour 2"):
        unsound.write(tmp_path)
    assert not list(tmp_path.iterdir())
    unsound.write(tmp_path, force=True)
    assert "oscillates on neighbour 2" in (tmp_path / "controller.yaml").read_text(encoding="utf-8")


def test_a_command_that_jumps_as_far_as_an_interlock_holds_is_reported(tuned: TunedTable) -> None:
    trials = cast(Trials, SimpleNamespace(s=load_robust("default")[1]))
    own = dataclasses.replace(tuned.best.trials[0], jump=0.42, at_limit=0.0)
    jumps = dataclasses.replace(tuned.best, trials=(own,), rings=0.5)
    margins = dataclasses.replace(tuned.margins, sensitivity=1.2, stable=True)
    (told,) = findings(trials, jumps, np.zeros((10, 3)), margins)
    assert told.startswith("the command jumps by 0.42 in a sample; an interlock holds the table above 0.3")
    assert tuned.best.trials[0].jump < 0.3


def test_motion_beyond_the_valve_is_reported_with_the_scale_that_fits(soft: TableParameters, tmp_path: Path) -> None:
    weak = soft.with_values({"valve.flow_coefficient": 5e-8})
    found = tune_table(weak, short_tuning(tmp_path, 1), laws=["feedforward_pi"], progress=False)
    (told,) = [text for text in found.findings if "saturates" in text]
    scale = float(told.rpartition(": ")[2].split()[0])
    assert 0.2 <= scale <= 0.7


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (500.0, "needs {mass: kg}"),
        ({"mass": "much"}, "needs {mass: kg}"),
        ({"mass": -1.0}, "negative"),
        ({"mass": 1.0, "hertz": 4.0}, "hertz"),
    ],
)
def test_load_that_is_none_is_reported_with_its_line(given: object, told: str) -> None:
    assert load_of({"mass": 150, "frequency": 4}, "loads") == Load(150.0, 4.0)
    with pytest.raises(ShakeError, match=told):
        load_of(given, "file: loads")


def test_uncertainty_beside_a_table_is_read_and_a_wrong_one_is_named(tmp_path: Path) -> None:
    path = tmp_path / "uncertainty.json"
    path.write_text('{"names": ["valve.flow_coefficient"], "covariance": [[1e-18]]}', encoding="utf-8")
    np.testing.assert_array_equal(read_uncertainty(path).covariance, [[1e-18]])
    path.write_text('{"names": ["valve.flow_coefficient"], "covariance": [[1, 2]]}', encoding="utf-8")
    with pytest.raises(ShakeError, match="covariance of shape"):
        read_uncertainty(path)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--out", "x"], "either a CONTROLLER or --table"),
        (["pid", "--table", "bergamo", "--out", "x"], "either a CONTROLLER or --table"),
        (["--table", "bergamo", "--loads", "1", "--out", "x"], "--loads: not with --table"),
        (["--table", "bergamo", "--laws", "pid", "--out", "x"], "unknown law 'pid'"),
    ],
)
def test_mistake_in_the_command_is_one_line(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["tune", *arguments]) == 2
    assert told in capsys.readouterr().err
