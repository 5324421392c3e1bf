"""Result folders are whole or not there, and report.json keeps its contract."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from closed_loops import command

from shake_ros import result_folder
from shake_ros.fit.uncertainty import Estimate
from shake_ros.physics.effects import EFFECTS, PLACES
from shake_ros.quantities import ShakeError
from shake_ros.report.report_json import close_loop_json, parameters_json
from shake_ros.result_folder import new_folder, write_json

QUANTITIES = {"position", "velocity", "direction", "load_pressure", "valve_opening", "flow", "time", "frequency"}


def number(value: Any) -> bool:
    return isinstance(value, float) and math.isfinite(value)


def check_parameters(content: Any) -> None:
    assert isinstance(content, dict) and content
    for name, entry in content.items():
        assert isinstance(name, str)
        assert set(entry) == {"value", "std_error", "unit"}
        assert number(entry["value"])
        assert entry["std_error"] is None or (number(entry["std_error"]) and entry["std_error"] >= 0.0)
        assert isinstance(entry["unit"], str)


def check_error(content: Any, learn: list[str], hold: list[str]) -> None:
    assert set(content) == {"learn", "hold", "test"}
    assert content["test"] == {}
    for role, names in (("learn", learn), ("hold", hold)):
        assert list(content[role]) == names
        for entry in content[role].values():
            assert set(entry) == {"velocity", "acceleration"}
            assert all(number(e) and e >= 0.0 for e in entry.values())


def check_report(report: Any) -> None:
    """The whole contract of report.json of `close_loop`."""
    keys = ["schema", "model", "recordings", "noise", "baseline", "steps", "final", "remaining"]
    assert list(report) == [*keys, "function", "ended_early", "form_errors", "open", "failed"]
    assert report["failed"] == []
    assert set(report["form_errors"]) == set(report["final"]["parameters"])
    assert all(number(e) and e >= 0.0 for e in report["form_errors"].values())
    assert report["function"] is None
    assert report["ended_early"] is False
    assert report["schema"] == "shake_ros.close_loop/1"
    assert report["model"] in ("full", "reduced")
    assert set(report["recordings"]) == {"learn", "hold", "test"}
    learn, hold = report["recordings"]["learn"], report["recordings"]["hold"]
    assert set(report["noise"]) == {"velocity", "acceleration"}
    assert all(number(n) and n > 0.0 for n in report["noise"].values())
    for part in (report["baseline"], report["final"]):
        assert set(part) == {"parameters", "error"}
        check_parameters(part["parameters"])
        check_error(part["error"], learn, hold)
    assert isinstance(report["steps"], list)
    for step in report["steps"]:
        keys = {"effect", "alternatives", "place", "parameters", "evidence", "error"}
        assert set(step) - {"depends_on"} == keys | {"state", "reason", "odds", "worth", "at_bound"}
        assert step["state"] in ("established", "likely", "one of these")
        assert (step["state"] == "one of these") == bool(step["alternatives"])
        assert step["worth"] > 1.0
        assert set(step["at_bound"]) <= set(step["parameters"])
        assert set(step.get("depends_on", [])) <= QUANTITIES
        assert step["effect"] in {*EFFECTS, "unlisted"}
        assert isinstance(step["alternatives"], list)
        assert set(step["alternatives"]) <= set(EFFECTS) - {step["effect"]}
        assert step["place"] in PLACES
        check_parameters(step["parameters"])
        assert isinstance(step["evidence"], dict)
        check_error(step["error"], learn, hold)
    remaining = report["remaining"]
    keys = {"above_noise", "place", "depends_on", "text", "candidates", "validation_with_candidates"}
    assert set(remaining) == keys | {"latent_force", "predictable", "innovations", "process_noise"}
    assert set(remaining["latent_force"]) == set(learn) | set(hold)
    assert remaining["process_noise"] is None or remaining["process_noise"] > 1.0
    assert set(remaining["validation_with_candidates"]) == (set(hold) if remaining["candidates"] else set())
    for doubtful in remaining["candidates"]:
        assert doubtful["state"] == "not established"
        assert doubtful["effect"] not in {s["effect"] for s in report["steps"]}
    assert isinstance(remaining["above_noise"], bool)
    assert remaining["place"] is None or remaining["place"] in PLACES
    assert set(remaining["depends_on"]) <= QUANTITIES
    assert isinstance(remaining["text"], str) and remaining["text"]


def refuse(name: str) -> None:
    raise AssertionError(f"{name} in JSON")


def read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


@pytest.mark.parametrize("case", ["spool_deadband", "nothing"])
def test_report_of_a_closed_loop_keeps_the_contract(case: str) -> None:
    run = command(case)
    report = read(run.out / "report.json")
    check_report(report)
    assert report["recordings"] == {"learn": ["learn"], "hold": ["hold"], "test": []}
    expected = json.loads(json.dumps(close_loop_json(run.result, ["learn"], ["hold"], "full")))
    diagnosed = ("predictable", "innovations")  # which `diagnose` adds to what the search tells
    expected["remaining"] |= {key: report["remaining"][key] for key in diagnosed}
    assert report == {**expected, "open": False, "failed": []}  # established, or nothing


def test_step_of_the_report_names_the_effect_with_its_parameters_and_evidence() -> None:
    report = read(command("spool_deadband").out / "report.json")
    (step,) = report["steps"]
    assert step["effect"] == "spool_deadband"
    assert step["place"] == "valve"
    assert list(step["parameters"]) == ["effects.spool_deadband.width", "effects.spool_deadband.closed"]
    assert step["parameters"]["effects.spool_deadband.width"]["value"] == pytest.approx(0.02, rel=0.05)
    assert report["final"]["error"] == step["error"]
    assert step["evidence"]["ranking"][0]["effect"] == "spool_deadband"
    assert "lowest error on the validation data" in step["evidence"]["why"]
    before, after = (report[k]["error"]["hold"]["hold"]["acceleration"] for k in ("baseline", "final"))
    assert after < 0.1 * before


def test_steps_are_empty_where_nothing_is_missing() -> None:
    report = read(command("nothing").out / "report.json")
    assert report["steps"] == []
    assert report["final"] == report["baseline"]
    assert report["remaining"]["above_noise"] is False
    assert report["remaining"]["place"] is None
    assert report["remaining"]["depends_on"] == []


def test_parameter_on_a_bound_has_null_for_a_standard_error() -> None:
    content = parameters_json([Estimate("a.b", 2.0, None, "N"), Estimate("a.c", 3.0, 0.5, "m")])
    assert content == {
        "a.b": {"value": 2.0, "std_error": None, "unit": "N"},
        "a.c": {"value": 3.0, "std_error": 0.5, "unit": "m"},
    }


def make(out: Path, *, force: bool = False, interruption: BaseException | None = None) -> None:
    with new_folder(out, force=force) as folder:
        (folder / "new.txt").write_text("new", encoding="utf-8")
        if interruption is not None:
            raise interruption


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_folder_appears_with_its_content(tmp_path: Path) -> None:
    make(tmp_path / "deep" / "out")
    assert names(tmp_path / "deep") == ["out"]
    assert names(tmp_path / "deep" / "out") == ["new.txt"]
    assert (tmp_path / "deep" / "out").stat().st_mode & 0o777 == 0o755


@pytest.mark.parametrize("interruption", [KeyboardInterrupt(), ShakeError("bad"), OSError(28, "No space left")])
def test_interrupted_run_leaves_no_half_written_folder(tmp_path: Path, interruption: BaseException) -> None:
    with pytest.raises(type(interruption)):
        make(tmp_path / "out", interruption=interruption)
    assert names(tmp_path) == []


def test_interrupted_replacement_leaves_the_earlier_folder_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.txt").write_text("old", encoding="utf-8")
    with pytest.raises(KeyboardInterrupt):
        make(tmp_path / "out", force=True, interruption=KeyboardInterrupt())
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["old.txt"]


def test_replacement_that_fails_at_the_last_moment_puts_the_earlier_folder_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.txt").write_text("old", encoding="utf-8")
    replace = os.replace

    def fail(source: Path, target: Path) -> None:
        if (Path(source) / "new.txt").exists():
            raise OSError(5, "Input/output error")
        replace(source, target)

    monkeypatch.setattr(result_folder.os, "replace", fail)
    with pytest.raises(ShakeError, match="out: cannot be replaced"):
        make(tmp_path / "out", force=True)
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["old.txt"]


def test_folder_that_one_stands_in_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ShakeError, match="cannot be replaced"):
        make(Path("."), force=True)
    assert names(tmp_path) == []


def test_existing_folder_is_not_touched_without_force(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.txt").write_text("old", encoding="utf-8")
    with pytest.raises(ShakeError, match=r"out: exists already \(--force replaces it\)"):
        make(tmp_path / "out")
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["old.txt"]


def test_force_replaces_the_whole_folder(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old.txt").write_text("old", encoding="utf-8")
    make(tmp_path / "out", force=True)
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["new.txt"]


def test_folder_below_a_file_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(ShakeError, match="cannot be created") as caught:
        make(tmp_path / "file" / "out")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_json_holds_null_for_a_number_that_is_none(tmp_path: Path, value: float) -> None:
    write_json(tmp_path / "report.json", {"error": value, "errors": (1.0, value)})
    read = json.loads((tmp_path / "report.json").read_text(), parse_constant=pytest.fail)
    assert read == {"error": None, "errors": [1.0, None]}


def test_result_that_json_cannot_hold_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="not JSON serializable"), new_folder(tmp_path / "out") as folder:
        write_json(folder / "report.json", {"error": object()})
    assert names(tmp_path) == []


TERMINATED = """
import sys, time
from pathlib import Path
from shake_ros.__main__ import leave_on_terminate
from shake_ros.result_folder import new_folder

leave_on_terminate()
with new_folder(Path(sys.argv[1])) as folder:
    (folder / "half").write_text("half")
    print("filling", flush=True)
    while True:  # a signal just before one long sleep would be heard at its end only
        time.sleep(0.01)
"""


def test_a_terminated_command_leaves_no_half_made_folder(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with subprocess.Popen([sys.executable, "-c", TERMINATED, str(out)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "filling\n"
        assert list(tmp_path.iterdir())
        process.terminate()
        assert process.wait(30) == 143
    assert list(tmp_path.iterdir()) == []
