"""compare and tune as commands: a small comparison, what they write, and what they refuse."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from pages import read_page

from shake_ros.__main__ import main
from shake_ros.control.laws import CONTROLLERS
from shake_ros.settings import find, load_variant, read_yaml

LABELS = ("feedforward PI, printed", "super-twisting, printed")


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The default comparison on two short sines, one load, one perturbed table and two controllers."""
    folder = tmp_path_factory.mktemp("compare")
    sine = read_yaml(find("reference", "sine_20mm_2hz"))
    sine["duration"] = 1.0
    sine["shaping"]["soft_start"] = sine["shaping"]["soft_stop"] = 0.25
    (folder / "short.yaml").write_text(yaml.safe_dump(sine), encoding="utf-8")
    content = read_yaml(find("compare", "default"))
    content["references"] = [str(folder / "short.yaml")]
    content["figure_reference"] = "short"
    content["loads"] = [200.0]
    content["rest"] = 0.2
    content["perturbed"]["count"] = 1
    content["entries"] = {label: content["entries"][label] for label in LABELS}
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def result(settings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out") / "small"
    assert main(["compare", "--settings", str(settings), "--out", str(out)]) == 0
    return out


def content_of(out: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((out / "compare.json").read_text(encoding="utf-8"))
    return content


def test_every_controller_has_its_runs_with_units(result: Path) -> None:
    content = content_of(result)
    assert content["schema"] == "shake_ros.compare/1"
    assert [(r["entry"], r["reference"], r["load"]) for r in content["runs"]] == [(x, "short", 200.0) for x in LABELS]
    assert [(r["entry"], r["perturbed_table"]) for r in content["perturbed_runs"]] == [(x, 0) for x in LABELS]
    figures = set(content["runs"][0]) - {"entry", "reference"}
    assert figures == set(content["units"])
    assert content["units"]["delay"] == "s"
    for row in content["runs"]:
        assert 0.0 < row["position_error"] < 0.3
        assert row["thd"] > 0.0
        assert not row["unstable"]


def test_page_stands_alone_with_its_figures(result: Path) -> None:
    page = (result / "report.html").read_text(encoding="utf-8")
    charts = [chart["name"] for chart in read_page(page).charts]
    assert charts == ["errors_1", "spectra_1"]
    for label in LABELS:
        assert label in page


def test_summary_of_one_run_is_that_run(result: Path) -> None:
    content = content_of(result)
    for summary, row in zip(content["summaries"], content["runs"], strict=True):
        for name in ("mean", "worst"):
            assert summary[name]["position_error"] == pytest.approx(row["position_error"])


def test_existing_folder_and_wrong_names_are_refused(
    result: Path, settings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (result / "compare.json").read_bytes()
    out = str(tmp_path / "new")
    for arguments, message in (
        (["--out", str(result)], "exists already (--force replaces it)"),
        (["--out", out, "--only", "PD"], "unknown controller 'PD'"),
        (["--out", out, "--settings", "none"], "unknown compare 'none'"),
        (["--out", out, "--settings", str(settings), "--record", "absent.smc"], "absent.smc"),
    ):
        assert main(["compare", *arguments]) == 2
        error = capsys.readouterr().err.strip().splitlines()[-1]
        assert message in error
    assert (result / "compare.json").read_bytes() == before
    assert not Path(out).exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"loads": None, "load": [1.0]}, "unknown key 'load'"),
        ({"entries": {"a": {"controller": "pid", "observer": "model", "model": "true"}}}, "unknown model 'true'"),
        ({"entries": {"a": {"controller": "pit", "observer": "model", "model": "none"}}}, "unknown controller 'pit'"),
    ],
)
def test_wrong_settings_name_the_file(
    change: dict[str, Any], message: str, settings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = {**read_yaml(settings), **change}
    path = tmp_path / "wrong.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    assert main(["compare", "--settings", str(path), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert message in error
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def tuned(settings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A few evaluations of the feedforward PI on the small comparison's plant."""
    folder = tmp_path_factory.mktemp("tune")
    content = read_yaml(find("tune", "default"))
    content.update(plant=str(settings), begin=0.1, seconds=0.5, loads=[200.0], perturbed=1)
    content["references"] = [str(settings.parent / "short.yaml")]
    (folder / "few.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    out = folder / "new.yaml"
    arguments = ["tune", "feedforward_pi", "--settings", str(folder / "few.yaml"), "--evaluations", "6"]
    assert main([*arguments, "--out", str(out)]) == 0
    return out


def test_tuned_gains_are_a_configuration_with_their_origin(tuned: Path) -> None:
    kind, parameters = load_variant("controller", str(tuned), CONTROLLERS)
    _, printed = load_variant("controller", "feedforward_pi", CONTROLLERS)
    assert kind == "feedforward_pi"
    assert parameters.limit == printed.limit
    assert parameters != printed
    text = tuned.read_text(encoding="utf-8")
    assert text.startswith("# ./shake tune feedforward_pi --settings ")
    before, after = (float(word) for word in re.findall(r"\d+\.\d+", text.splitlines()[1])[:2])
    assert math.isfinite(before)
    assert after <= before


def test_tuned_file_is_not_overwritten(tuned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = tuned.read_bytes()
    assert main(["tune", "feedforward_pi", "--out", str(tuned)]) == 2
    assert "exists already (--force replaces it)" in capsys.readouterr().err
    assert tuned.read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing_such"], "unknown controller 'nothing_such'"),
        (["none"], "no gain that is not zero"),
        (["pid", "--evaluations", "0"], "evaluations = 0: must be at least 1"),
        (["pid", "--perturbed", "-1"], "perturbed = -1"),
        (["pid", "--references", "quake"], "unknown reference 'quake'"),
    ],
)
def test_tune_refuses_what_it_cannot_do(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new.yaml"
    assert main(["tune", *arguments, "--out", str(out)]) == 2
    assert message in capsys.readouterr().err.strip().splitlines()[-1]
    assert not out.exists()
