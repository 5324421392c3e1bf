"""`identify` from the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from closed_loops import bag
from hidden_table import OWN
from pages import read_page

from shake_ros import __main__
from shake_ros.search import declared_fit
from shake_ros.settings import load_search, load_table

SEARCH = load_search()


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("bags")
    return bag("nothing", 1, folder / "first", 2.0), bag("nothing", 2, folder / "second", 2.0)


@pytest.fixture(scope="module")
def out(bags: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("identified") / "out"
    given = ["identify", "--learn", str(bags[0]), "--hold", str(bags[1]), "--out", str(folder)]
    assert __main__.main(given) == 0
    return folder


def test_parameters_are_found_with_their_standard_errors(out: Path) -> None:
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report["schema"] == "shake_ros.identify/1"
    assert report["recordings"] == {"learn": ["first"], "hold": ["second"]}
    assert len(report["parameters"]) == 10  # the table passes through rest in a form of its own, so that is freed too
    assert list(report["parameters"])[-2:] == ["friction.transition_velocity", "friction.transition_sharpness"]
    modulus = report["parameters"]["bulk_modulus.modulus"]
    assert set(modulus) == {"value", "std_error", "unit"}
    assert modulus["unit"] == "Pa"
    assert modulus["value"] == pytest.approx(OWN["modulus"], rel=0.01)
    assert 0.0 < modulus["std_error"] < 0.01 * OWN["modulus"]


def test_every_recording_has_its_error(out: Path) -> None:
    error = json.loads((out / "report.json").read_text(encoding="utf-8"))["error"]
    assert error["learn"]["first"]["acceleration"] < 0.05
    assert error["hold"]["second"]["acceleration"] < 0.05
    assert set(error["hold"]["second"]) == {"velocity", "acceleration"}


def test_fitted_table_loads_again(out: Path) -> None:
    table = load_table(str(out / "table.yaml"))
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    for name, entry in report["parameters"].items():
        assert table.value(name) == pytest.approx(entry["value"], rel=1e-12)


def test_residual_tests_and_what_the_recordings_identify_are_reported(out: Path) -> None:
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    diagnosis = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    tested = [r for r in diagnosis["residuals"] if r["white"] is not None]
    assert [(r["recording"], r["held_out"]) for r in tested] == [("first", False), ("second", True)]
    assert {r["channel"] for r in tested} == {"acceleration"}
    matrix = diagnosis["correlation"]["matrix"]
    assert diagnosis["correlation"]["names"] == list(report["parameters"])
    assert matrix[4][4] == pytest.approx(1.0)
    best = diagnosis["helpful_recordings"][0]
    assert best["name"] in diagnosis["text"]
    assert max(best["relative_deviation"].values()) < max(diagnosis["relative_deviation"].values())
    page = (out / "report.html").read_text(encoding="utf-8")
    read = read_page(page)
    assert "What these recordings identify" in read.words
    assert read.headings[1:4] == ["Measured against simulated", "Errors", "What remains"]
    assert [c["name"] for c in read.charts][:2] == ["history_second", "spectrum_second"]


def test_validation_data_are_not_needed(
    bags: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert __main__.main(["identify", "--learn", str(bags[0]), "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "bulk_modulus.modulus" in printed
    assert re.search("first +estimation", printed)
    assert "there was no validation data" in printed
    assert not re.search("second +validation", printed)
    assert json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))["error"]["hold"] == {}


def test_wrong_recording_is_one_line_and_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["identify", "--learn", str(tmp_path / "nowhere"), "--out", str(tmp_path / "out")]
    assert __main__.main(given) == 2
    error = capsys.readouterr().err
    assert error.startswith("shake_ros identify: ")
    assert "nowhere" in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_interrupted_identify_leaves_nothing(
    bags: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*arguments: object, **more: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(declared_fit, "identify", interrupt)
    assert __main__.main(["identify", "--learn", str(bags[0]), "--out", str(tmp_path / "out")]) == 130
    assert list(tmp_path.iterdir()) == []
