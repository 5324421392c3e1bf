"""The sensitivity study of thesis 6.3.4 and its command."""

from __future__ import annotations

import json

import numpy as np
import pytest

from shake_ros import __main__ as shake_ros
from shake_ros.settings import load_table
from shake_ros.thesis.sensitivity import sensitivity, values_of


def main(arguments: list[str]) -> int:
    return shake_ros.main(["sensitivity", *arguments])


@pytest.fixture(scope="module")
def results():
    return sensitivity().studies


def test_theta_5_is_the_modulus_over_half_the_volume():
    table = load_table("bergamo")
    values = values_of(table, 1.28e-7, {"theta_5": 9.4e12, "theta_6": 1e-12, "theta_7": 1.1})
    assert values["bulk_modulus.modulus"] == pytest.approx(1.1555e9, rel=1e-3)


def test_theta_7_multiplies_the_coefficient_that_the_thesis_prints():
    values = values_of(load_table("bergamo"), 1.28e-7, {"theta_5": 9.4e12, "theta_6": 1e-12, "theta_7": 1.23})
    assert values["valve.flow_coefficient"] == pytest.approx(1.5744e-7)


def test_with_the_soft_zone_the_modulus_matters_most_to_the_acceleration_as_the_thesis_says():
    found = sensitivity("table_6_9")
    spread = {name: study.spread["acceleration"] for name, study in found.studies.items()}
    assert spread["theta_5"] > spread["theta_7"] > 0.0
    assert spread["theta_5"] > spread["theta_6"]


def test_stiffness_shows_in_the_acceleration_and_hardly_in_the_position(results):
    spread = results["theta_5"].spread
    assert spread["acceleration"] > 2.0 * spread["position"]


def test_flow_gain_scales_the_motion(results):
    study = results["theta_7"]
    size = np.std(study.motion[:, -2000:, 1], axis=1)
    np.testing.assert_allclose(size / size[1], study.values / study.values[1], rtol=0.03)
    assert np.ptp(list(study.spread.values())) < 0.05


def test_stiffness_moves_the_harmonics_near_the_oil_column(results):
    seventh = results["theta_5"].harmonics([7])  # of 21 Hz; the oil column stands at 17.7, 25.6 and 29.5 Hz
    assert np.ptp(seventh) > 0.5 * seventh.mean()


def test_the_command_draws_every_figure_and_overwrites_nothing(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    assert main(["--out", str(tmp_path)]) == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"figure_6_{k}.png" for k in range(19, 25)} | {"sensitivity.json"}
    assert set(json.loads((tmp_path / "sensitivity.json").read_text())) == {"theta_5", "theta_6", "theta_7"}
    capsys.readouterr()
    assert main(["--out", str(tmp_path)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_an_unknown_study_is_one_line_and_exit_code_2(tmp_path, capsys):
    assert main(["--study", "nothing", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
