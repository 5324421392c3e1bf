"""`close_loop` from the command line: what it prints and writes, and how it refuses."""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from closed_loops import DEAD_BAND, bag, command, recording

from shake_ros import __main__
from shake_ros.api.model import model
from shake_ros.api.tune_table import read_uncertainty
from shake_ros.cli.repair import write_next
from shake_ros.control.reference.motion import Envelope
from shake_ros.experiment_design.next_recording import NextRecording
from shake_ros.physics.plant.simulation import run
from shake_ros.recordings.bags import write_table_recording
from shake_ros.repair import close_loop as closing
from shake_ros.settings import load_table

TIME = np.arange(1500) * 0.001
WAVE = np.sin(4.0 * np.pi * TIME)


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("bags")
    return bag("nothing", 1, folder / "learn", 1.5), bag("nothing", 2, folder / "hold", 1.5)


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one line on standard error of a command that ends with exit code 2 and prints nothing else."""
    assert __main__.main([str(a) for a in arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    lines = [line for line in output.err.splitlines() if line.startswith("shake_ros ")]
    assert len(lines) == 1
    assert output.err.endswith(lines[0] + "\n")
    assert "Traceback" not in output.err
    return lines[0]


@pytest.fixture
def refused(tmp_path: Path, bags: tuple[Path, Path], capsys: pytest.CaptureFixture[str]):
    """Refusal of a `close_loop` on given recordings; its result folder must not come to be."""

    def call(*more: object, learn: Path = bags[0], hold: Path = bags[1]) -> str:
        out = tmp_path / "results" / "out"
        line = refusal(capsys, "close_loop", "--learn", learn, "--hold", hold, "--out", out, *more)
        assert not out.parent.exists()
        return line

    return call


def test_command_names_the_effect_and_prints_before_and_after() -> None:
    done = command("spool_deadband")
    assert done.code == 0
    assert "Missing: spool_deadband." in done.printed
    width = re.search(r"spool_deadband \(valve\): width ([\d.]+) ± ", done.printed)
    assert width is not None
    assert float(width[1]) == pytest.approx(DEAD_BAND, rel=0.005)
    row = re.search(r"^hold +validation +([\d.]+) % +([\d.]+) % +([\d.]+) % +([\d.]+) %", done.printed, re.MULTILINE)
    assert row is not None
    assert float(row[4]) < 0.1 * float(row[3])
    assert "\nWhat remains\n" in done.printed
    assert done.printed.splitlines()[-1] == f"report: {done.out / 'report.html'}"


def test_effect_is_named_from_the_acceleration_alone() -> None:
    done = command("spool_deadband", position=False)
    assert done.code == 0
    assert "Missing: spool_deadband." in done.printed
    assert "learn: no position was measured; the answer is partial" in done.printed
    report = json.loads((done.out / "report.json").read_text(encoding="utf-8"))
    (effect,) = report["steps"]
    assert effect["parameters"]["effects.spool_deadband.width"]["value"] == pytest.approx(DEAD_BAND, rel=0.05)
    assert set(report["noise"]) == {"acceleration"}
    error = report["final"]["error"]["hold"]["hold"]
    assert set(error) == {"acceleration"}
    assert error["acceleration"] < 0.05


def test_command_says_that_nothing_is_missing() -> None:
    done = command("nothing")
    assert done.code == 0
    assert "Nothing is added: no effect lowers the error on the validation data." in done.printed
    assert "Nothing above the noise" in done.printed


@pytest.mark.parametrize("case", ["spool_deadband", "nothing"])
def test_result_folder_holds_report_diagnosis_page_and_table_and_nothing_else(case: str) -> None:
    done = command(case)
    wanted = {"diagnosis.json", "report.html", "report.json", "table.yaml", "uncertainty.json"}
    if case != "nothing":
        wanted |= {"tracking.json", "controller.yaml", "observer.yaml", "tune.json"}
    assert {p.name for p in done.out.iterdir()} == wanted
    assert sorted(p.name for p in done.out.parent.iterdir()) == ["hold", "learn", "out"]


def test_gains_made_for_the_found_table_stand_beside_before_and_after() -> None:
    done = command("spool_deadband")
    content = json.loads((done.out / "tracking.json").read_text(encoding="utf-8"))
    assert content["tuned"]["acceleration"] < content["before"]["acceleration"]
    assert content["tuned"]["position"] < 0.01
    assert content["ringing"]["tuned"] < 0.2 * content["ringing"]["after"]
    assert content["ringing"]["tuned"] < 1.0  # a table whose oil column is hardly damped in slow motion
    assert "do not use them" not in done.printed
    assert content["margins"]["sensitivity"] < 1.8
    assert re.search(r"^extended model, gains made for it +[\d.]+ %", done.printed, re.MULTILINE)
    page = (done.out / "report.html").read_text(encoding="utf-8")
    assert "extended model, gains made for it" in page
    assert "where it is least robust: gain" in page
    assert "effects.spool_deadband.width" in read_uncertainty(done.out / "uncertainty.json").names


def test_extended_table_loads_again_and_moves_as_the_fitted_one() -> None:
    done = command("spool_deadband")
    again = load_table(str(done.out / "table.yaml"))
    record = recording("spool_deadband", 2, "hold")
    assert set(again.effects) == {"spool_deadband"}
    assert np.array_equal(
        run(again, record.commands, record.sample_time),
        run(done.result.final.table, record.commands, record.sample_time),
    )
    assert (
        (done.out / "table.yaml").read_text(encoding="utf-8").startswith("# Fitted to learn by close_loop: spool_dead")
    )


def test_declared_table_alone_is_written_where_nothing_is_missing() -> None:
    content = yaml.safe_load((command("nothing").out / "table.yaml").read_text(encoding="utf-8"))
    assert "effects" not in content
    assert content["bulk_modulus"]["modulus"] == pytest.approx(9.0e8, rel=0.01)


@pytest.mark.parametrize("change", ["specimen_mass=137.5", "body.specimen_mass=137.5"])
def test_set_changes_a_declared_value(change: str) -> None:
    key, _, value = change.partition("=")
    table = model("full", "bergamo", {key: float(value), "supply_pressure": 1.5e7}).table
    assert table is not None
    assert table.value("body.specimen_mass") == 137.5
    assert table.value("supply.supply_pressure") == 1.5e7
    assert table.value("body.table_mass") == load_table("bergamo").value("body.table_mass")


def test_set_reaches_the_fit(
    tmp_path: Path, bags: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = []

    def stop(model, *arguments, **more):  # type: ignore[no-untyped-def]
        seen.append(model.table.value("body.specimen_mass"))
        raise KeyboardInterrupt

    monkeypatch.setattr(closing, "close_loop", stop)
    arguments = ["close_loop", "--learn", str(bags[0]), "--hold", str(bags[1]), "--out", str(tmp_path / "out" / "x")]
    assert __main__.main([*arguments, "--set", "specimen_mass=150", "--set", "tank_pressure=2e5"]) == 130
    assert seen == [150.0]
    assert list(tmp_path.iterdir()) == []
    capsys.readouterr()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("specimen_mas=200.0", "did you mean"),
        ("specimen_mass", "expected KEY=NUMBER"),
        ("specimen_mass=heavy", "expected KEY=NUMBER"),
        ("specimen_mass=nan", "specimen_mass = nan is not a finite number"),
        ("specimen_mass=-200.0", "specimen_mass = -200 is outside"),
        ("time_constant=0.1", "could be effects."),
    ],
)
def test_wrong_set_is_refused_in_one_line(refused, change: str, text: str) -> None:
    assert text in refused("--set", change)


def test_missing_recording_is_refused_by_name(refused, tmp_path: Path) -> None:
    assert "nowhere" in refused(learn=tmp_path / "nowhere")


def test_missing_configuration_is_refused_by_name(refused, tmp_path: Path) -> None:
    assert "nowhere.yaml" in refused("--config", tmp_path / "nowhere.yaml")
    assert "did you mean 'bergamo'" in refused("--config", "bergam")


def test_impossible_value_in_the_configuration_is_refused_with_its_place(refused, tmp_path: Path) -> None:
    content = load_table("bergamo").to_mapping()
    content["body"]["piston_area"] = -1.0
    path = tmp_path / "table.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    line = refused("--config", path)
    assert "table.yaml: body" in line
    assert "piston_area = -1" in line


def test_recording_without_a_needed_topic_is_refused_by_topic(refused, tmp_path: Path) -> None:
    wrong = write_table_recording(tmp_path / "silent", TIME, None, 0.05 * WAVE, WAVE)
    line = refused(learn=wrong)
    assert "silent" in line
    assert "valve_command" in line


def test_recording_cut_to_its_head_is_refused_by_name(refused, bags: tuple[Path, Path], tmp_path: Path) -> None:
    cut = shutil.copytree(bags[0], tmp_path / "cut")
    (storage,) = cut.glob("*.mcap")
    os.truncate(storage, 200)
    assert "cut" in refused(learn=cut)


def test_recording_of_nothing_but_nan_is_refused_by_topic(refused, tmp_path: Path) -> None:
    wrong = write_table_recording(tmp_path / "broken", TIME, np.full(len(TIME), np.nan), 0.05 * WAVE, WAVE)
    line = refused(learn=wrong)
    assert "broken" in line
    assert "valve_command" in line


def test_nan_every_half_second_leaves_nothing_to_fit(refused, tmp_path: Path) -> None:
    command_ = np.where(np.arange(len(TIME)) % 500 < 5, np.nan, WAVE)
    wrong = write_table_recording(tmp_path / "holes", TIME, command_, 0.05 * WAVE, WAVE)
    assert "holes: no segment of 1 s without a gap" in refused(learn=wrong)


def test_recording_in_both_sets_is_refused(refused, bags: tuple[Path, Path], tmp_path: Path) -> None:
    assert "learn: given both as estimation and as validation data" in refused(hold=bags[0])
    assert "given both" in refused(hold=shutil.copytree(bags[0], tmp_path / "copy" / "learn"))
    assert "hold: given both as validation and as test data" in refused("--test", bags[1])


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        (("--live",), "--live: is for --next"),
        (("--next", "--live", "--interlock", "bergamo"), "those of the graph's own interlock"),
        (("--next", "--most", "0"), "--most 0: 1 or more"),
    ],
)
def test_what_belongs_together_is_asked_together(refused, asked: tuple[str, ...], text: str) -> None:
    assert text in refused(*asked)


def test_existing_results_stay_without_force(
    bags: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine", encoding="utf-8")
    line = refusal(capsys, "close_loop", "--learn", bags[0], "--hold", bags[1], "--out", out)
    assert "exists already (--force replaces it)" in line
    assert [p.name for p in out.iterdir()] == ["mine.txt"]


def test_unknown_model_and_missing_arguments_end_with_exit_code_2(
    bags: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for more in (["--model", "half"], ["--out"]):
        given = ["close_loop", "--learn", str(bags[0]), "--hold", str(bags[1]), "--out", str(tmp_path / "out"), *more]
        with pytest.raises(SystemExit) as caught:
            __main__.main(given)
        assert caught.value.code == 2
    with pytest.raises(SystemExit) as caught:
        __main__.main(["close_loop", "--learn", str(bags[0]), "--out", str(tmp_path / "out")])
    assert caught.value.code == 2
    assert "--hold" in capsys.readouterr().err


def test_the_next_recording_lies_beside_the_report_and_in_it(tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text('{"steps": []}', encoding="utf-8")
    folder = write_next(NextRecording((), None, Envelope(0.1, 1.0, 10.0), 0.001, undecided=False), tmp_path)
    content = json.loads((tmp_path / "next.json").read_text(encoding="utf-8"))
    assert content["schema"] == "shake_ros.next/1"
    assert (content["open"], content["motion"], content["cannot"]) == (False, None, "")
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8")) == {"steps": [], "next": content}
    assert [p.name for p in folder.iterdir()] == ["report.html"]
