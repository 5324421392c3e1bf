"""A configuration from nameplates: what it holds, what it says it assumed, and that a fit takes it."""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import pytest
from hidden_table import SAMPLE_TIME, record

import shake_ros as sr
from shake_ros import __main__
from shake_ros.fit.records import Record
from shake_ros.fit.start.data_checks import contradictions
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table


def test_command_writes_a_file_that_a_model_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "mine.yaml"
    plates = "--bore 50 --rod 36 --stroke 260 --rated-flow 20 --supply 206 --table-mass 450 --hose-volume 0.1"
    assert __main__.main(["table", *plates.split(), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "assumed: rated flow at 70 bar over both edges together" in printed
    model = sr.model("full", out)
    assert model.kind == "unknown"
    assert model.declared.may_move("body.table_mass")
    assert {name for name, *_ in [(p["parameter"],) for p in model.parameters.rows]} >= {"friction.viscous"}
    assert __main__.main(["table", "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_numbers_follow_from_the_nameplates() -> None:
    made = sr.table(bore=0.05, rod=0.036, stroke=0.26, rated_flow=20 / 60000, hose_volume=1e-4, valve_frequency=150.0)
    area = pi * (0.05**2 - 0.036**2) / 4.0
    assert made.content["body"]["piston_area"] == pytest.approx(area)
    assert made.content["body"]["cylinder_volume"]["value"] == pytest.approx(0.26 * area + 1e-4, rel=1e-5)
    assert made.content["valve"]["flow_coefficient"]["value"] == pytest.approx(20 / 60000 / sqrt(35e5), rel=1e-5)
    assert made.content["valve"]["natural_frequency"]["value"] == pytest.approx(300.0 * pi, rel=1e-5)
    assert made.content["body"]["table_mass"] == "unknown"


def test_a_single_rod_takes_its_area_from_side_b_alone() -> None:
    made = sr.table(bore=0.05, rod=0.036, single_rod=True, stroke=0.26)
    body, full = made.content["body"], pi * 0.05**2 / 4.0
    assert body["piston_area"] == pytest.approx(full)
    assert body["area_ratio"] == pytest.approx(1.0 - (36.0 / 50.0) ** 2)
    volume_a, volume_b = 0.13 * full, 0.13 * full * body["area_ratio"]
    assert body["cylinder_volume"]["value"] == pytest.approx(volume_a + volume_b, rel=1e-5)
    assert body["volume_share"] == pytest.approx(volume_a / (volume_a + volume_b))


def test_without_bore_and_supply_area_and_pressure_are_said_to_be_a_gauge() -> None:
    assert sum("as a gauge" in line for line in sr.table().assumed) == 2


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"bore": 0.03, "rod": 0.04}, "not thinner"),
        ({"supply": -1.0}, "above 0"),
        ({"bore": 0.03, "single_rod": True}, "bore and rod"),
    ],
)
def test_impossible_nameplates_are_refused(wrong: dict[str, float], said: str) -> None:
    with pytest.raises(ShakeError, match=said):
        sr.table(**wrong)  # type: ignore[arg-type]


def test_declared_geometry_that_contradicts_the_recordings_is_said_with_its_numbers() -> None:
    made = record(1, 8.0)
    records = [Record("run", SAMPLE_TIME, made.commands, made.position, made.acceleration)]
    table = load_table("bergamo")
    assert contradictions(table, records) == []
    wrong = table.with_values({"body.piston_area": 3.0 * table.value("body.piston_area")})
    lines = contradictions(wrong, records)
    assert lines[0].startswith("velocity per command: declared 0.2")
    assert "body.piston_area = 0.00283686" in lines[0]
    assert contradictions(wrong, records, ("body.piston_area",)) == []
