"""The command that compares printed and fitted models with the real table's harmonics, on few runs and few starts."""

from __future__ import annotations

import contextlib
import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import yaml
from pages import read_page

from shake_ros import __main__ as shake_ros
from shake_ros.measured import models, runs
from shake_ros.measured.harmonics import account
from shake_ros.settings import find, load_table


def main(arguments: list[str]) -> int:
    return shake_ros.main(["measured_runs", *arguments])


RUNS = {
    "specimen_mass": 200.0,
    "runs": [
        {"amplitude": 0.2, "frequency": 10.0, "harmonics": {1: 12.7, 3: 2.66, 5: 0.40}},
        {"amplitude": 0.2, "frequency": 5.0, "harmonics": {1: 4.44, 3: 2.86, 5: 1.28, 7: 0.41}},
    ],
}
# What `./shake measured_runs --out DIR` prints for the soft zone, from its measured_runs.json.
FITTED = {
    "friction.coulomb_level": 340.69,
    "friction.stribeck_rise": 874.46,
    "friction.stribeck_decay": 136.84,
    "friction.viscous": 2047.0,
    "bulk_modulus.modulus": 5.4747e8,
    "leakage.internal": 1.358e-14,
    "leakage.external": 2.3015e-12,
    "valve.flow_coefficient": 1.80336e-7,
    "effects.soft_zone.depth": 0.82531,
    "effects.soft_zone.threshold": 6.2634e5,
    "effects.soft_zone.sharpness": 2.2486e-5,
}


def written(tmp_path: Path, content: object) -> str:
    path = tmp_path / "runs.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(path)


@contextlib.contextmanager
def shortened() -> Iterator[None]:
    """Fits of few steps from few starts: enough for the files, not for the figures."""
    with (
        mock.patch.object(models, "SHORT", 2),
        mock.patch.object(models, "LONG", 2),
        mock.patch.object(models, "STARTS", 1),
        contextlib.redirect_stderr(io.StringIO()),
    ):
        yield


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("measured")
    out, printed = folder / "out", io.StringIO()
    with shortened(), contextlib.redirect_stdout(printed):
        arguments = ["--runs", written(folder, RUNS), "--second", "accelerometer_lag", "--out", str(out)]
        assert main(arguments) == 0
    return out, printed.getvalue()


def test_distortion_after_the_fit_is_within_five_points_of_the_measured() -> None:
    problem, table = runs.read_problem(find("measured", "harmonics"))
    result = account(problem, table.with_values(FITTED).vector())
    assert result.rms <= 0.10
    assert np.all(np.abs(100 * result.distortion - [49.5, 22.6, 17.1, 71.2, 21.2]) < 5.0)
    assert np.all(np.abs(100 * result.whole_distortion - [49.5, 22.6, 17.1, 71.2, 21.2]) < 5.0)


def test_all_files_are_written_and_the_terminal_shows_what_the_text_file_holds(result: tuple[Path, str]) -> None:
    out, printed = result
    names = {path.name for path in out.iterdir()}
    tables = {"measured_runs.txt", "measured_runs.json", "harmonics.csv", "fitted_table.yaml"}
    assert names == tables | {"report.html"}
    assert [c["name"] for c in read_page((out / "report.html").read_text(encoding="utf-8")).charts] == [
        "harmonics",
        "traces",
    ]
    assert printed.startswith((out / "measured_runs.txt").read_text(encoding="utf-8"))


def test_every_number_of_the_table_of_amplitudes_is_in_the_csv(result: tuple[Path, str]) -> None:
    out, _ = result
    content = json.loads((out / "measured_runs.json").read_text(encoding="utf-8"))
    with (out / "harmonics.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["measured"]) for row in rows] == [12.7, 2.66, 0.40, 4.44, 2.86, 1.28, 0.41]
    for name, values in content["runs"][1]["simulated"].items():
        assert [float(row[name]) for row in rows[3:]] == pytest.approx(values, rel=1e-4)


def test_json_holds_errors_of_every_model_and_of_every_run_left_out(result: tuple[Path, str]) -> None:
    content = json.loads((result[0] / "measured_runs.json").read_text(encoding="utf-8"))
    assert content["schema"] == "shake_ros.measured_runs/1"
    assert [len(content[key]) for key in ("printed", "fitted", "seconds")] == [3, 2, 1]
    for model in content["fitted"] + content["seconds"]:
        assert len(model["left_out"]["run_rms"]) == 2
        simulated = np.concatenate([run["simulated"][model["name"]] for run in content["runs"]])
        measured = np.concatenate([run["measured"] for run in content["runs"]])
        assert model["rms"] == pytest.approx(np.sqrt(np.mean((simulated - measured) ** 2)), rel=1e-6)
    own = set(content["seconds"][0]["parameters"]) - set(content["fitted"][1]["parameters"])
    assert own == {"effects.accelerometer_lag.time_constant"}


def test_fitted_table_is_one_that_the_nodes_load(result: tuple[Path, str]) -> None:
    out, _ = result
    table = load_table(str(out / "fitted_table.yaml"))
    content = json.loads((out / "measured_runs.json").read_text(encoding="utf-8"))
    (best,) = [m for m in content["fitted"] if m["name"] == content["best"]]
    for name, entry in best["parameters"].items():
        assert table.value(name) == pytest.approx(entry["value"])


def test_a_result_is_replaced_with_force_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine").write_text("kept", encoding="utf-8")
    assert main(["--out", str(tmp_path)]) == 2
    assert "exists already (--force replaces it)" in capsys.readouterr().err
    assert (tmp_path / "mine").read_text(encoding="utf-8") == "kept"


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ({"specimen_mass": 200.0}, ": missing runs"),
        ({**RUNS, "masss": 1.0}, "unknown key 'masss'"),
        ({**RUNS, "runs": []}, "expected a list of runs"),
        ({**RUNS, "runs": [3]}, "run 1: expected amplitude, frequency, harmonics, got int"),
        ({**RUNS, "runs": [{**RUNS["runs"][0], "amplitude": 7.0}]}, "run 1: amplitude = 7.0"),  # type: ignore[index, dict-item]
        ({**RUNS, "specimen_mass": "heavy"}, "specimen_mass = 'heavy'"),
        ([1, 2], "expected specimen_mass, runs, got list"),
    ],
)
def test_bad_runs_are_one_line_with_file_and_value(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: object, named: str
) -> None:
    path = written(tmp_path, content)
    assert main(["--runs", path, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert path in error
    assert named in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("option", "name"), [("--extend", "soft_zon"), ("--second", "nothing"), ("--runs", "absent")])
def test_an_unknown_name_is_one_line_that_lists_the_known(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, name: str
) -> None:
    assert main([option, name, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert name in error
    assert "known:" in error


def test_an_extension_draws_the_same_starts_whatever_is_tried_beside_it() -> None:
    known = runs.read_extensions()
    assert [v.name for v in runs.chosen(["all"], known.single, "--extend")] == list(known.single)
    (alone,) = runs.chosen(["soft_zone"], known.single, "--extend")
    assert alone == known.second["soft_zone"]
    shared = {"exchanged_volume"}  # looks at the starts of soft_zone, which it is held against
    assert known.second["exchanged_volume"].seed == known.second["soft_zone"].seed
    assert len({v.seed for v in known.second.values()}) == len(known.second.keys() - shared)
