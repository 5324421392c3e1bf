"""record_scale from its command line: what it prints, writes and refuses."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from pages import read_page

from shake_ros import __main__ as shake_ros
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.reference_file import build_program


def main(arguments: list[str]) -> int:
    return shake_ros.main(["record_scale", *arguments])


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """20 s of noise under a bell, 3 m/s² at its peak, with an offset."""
    time = np.arange(2001) * 0.01
    noise = np.convolve(np.random.RandomState(2).standard_normal(2001), np.ones(8) / 8.0, "same")
    acceleration = noise * np.exp(-(((time - 8.0) / 4.0) ** 2))
    acceleration = 3.0 * acceleration / np.max(np.abs(acceleration)) + 0.05
    path = tmp_path / "noise.csv"
    rows = zip(time, acceleration, strict=True)
    path.write_text("time [s],acceleration [m/s2]\n" + "".join(f"{t:.2f},{a:.6f}\n" for t, a in rows))
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    try:
        code = main([str(a) for a in arguments])
    except SystemExit as stop:  # of argparse
        code = int(stop.code or 0)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_it_prints_peaks_before_and_after_with_the_factor(record: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, record, "--velocity", 0.05, "--time-scale", 0.5, "--fit")
    assert (code, err) == (0, "")
    assert "two_columns, 2001 samples of 0.01 s in m/s2" in out
    assert "Filtered to 0.25 … 12 Hz" in out
    assert re.search(r"velocity \[mm/s\] .* 50 +50$", out, re.MULTILINE)


def test_every_change_stands_on_the_first_lines(record: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, record, "--velocity", 0.05, "--time-scale", 0.5, "--fit")
    assert record.name in out.splitlines()[1]
    lines = out.partition("What was changed\n")[2].splitlines()
    assert lines[0].startswith("Filtered to 0.25 … 12 Hz and baseline-corrected: the peak acceleration goes")
    assert lines[1].startswith("Scaled by 0.")
    assert lines[2] == "The requested factor was 1; the factor is what the table's velocity allows."
    assert lines[3] == "Time is stretched by 0.5."


def test_a_scale_that_does_not_fit_is_refused_with_the_one_that_does(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scaled.csv"
    code, told, err = run(capsys, record, "--scale", 40, "--out", out)
    assert (code, told, out.exists()) == (2, "", False)
    assert err.count("\n") == 1
    assert "at the scale 40 it needs" in err
    fits = err.split("--scale ")[1].split()[0]
    code, told, _ = run(capsys, record, "--scale", fits, "--out", out)
    assert code == 0
    assert f"Scaled by {float(fits):.5g}" in told


def test_it_writes_columns_that_read_back_at_rest_and_within_the_limits(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "results" / "scaled.csv"
    assert run(capsys, record, "--stroke", 0.02, "--scale", "fill", "--out", out)[0] == 0
    columns = np.loadtxt(out, delimiter=",", skiprows=3)
    assert np.max(np.abs(columns[:, 3])) == pytest.approx(0.02, rel=1e-6)
    assert np.allclose(columns[-1, 1:], 0.0, atol=1e-9)
    again = read_accelerogram(out)
    assert again.warnings == ()
    assert np.allclose(again.acceleration, columns[:, 1])


def test_it_writes_a_reference_that_plays_the_same_motion(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns, configuration = tmp_path / "scaled.csv", tmp_path / "scaled.yaml"
    for out in (columns, configuration):
        assert run(capsys, record, "--stroke", 0.02, "--fit", "--out", out, "--force")[0] == 0
    program = build_program(str(configuration), 0.01)
    written = np.loadtxt(columns, delimiter=",", skiprows=3)
    assert np.allclose(program.states[:, 0], written[:, 3], atol=1e-8)
    assert np.allclose(program.states[:, 2], written[:, 1], atol=1e-6)


def test_it_draws_the_histories_and_the_response_spectrum(
    record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, record, "--out", tmp_path / "scaled.csv", "--figures", "svg")[0] == 0
    page = read_page((tmp_path / "scaled.html").read_text(encoding="utf-8"))
    assert [c["name"] for c in page.charts] == ["motion", "spectrum"]
    assert {p.name for p in (tmp_path / "scaled_figures").iterdir()} == {"motion.svg", "spectrum.svg"}


def test_several_files_go_to_a_folder(record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    second = record.with_name("second.csv")
    second.write_text(record.read_text())
    assert run(capsys, record, second, "--out", tmp_path / "folder")[0] == 0
    assert {p.name for p in (tmp_path / "folder").glob("*.csv")} == {"noise.csv", "second.csv"}


def test_nothing_is_overwritten_without_force(record: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "scaled.csv"
    out.write_text("mine")
    code, _, err = run(capsys, record, "--out", out)
    assert code == 2
    assert err == f"shake_ros record_scale: {out}: exists already (--force replaces it)\n"
    assert out.read_text() == "mine"
    assert run(capsys, record, "--out", out, "--force")[0] == 0
    assert out.read_text() != "mine"


def test_a_record_is_never_its_own_result(record: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = record.read_text()
    code, _, err = run(capsys, record, "--out", record, "--force")
    assert code == 2
    assert "is one of the files to be read" in err
    assert record.read_text() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scale", "much"], "neither a number nor 'fill'"),
        (["--scale", "-1"], "scale = -1 is outside"),
        (["--channel", "2"], "channel 2 of a file that holds 1"),
        (["--unit", "g"], "the heading says m/s2, not g"),
        (["--high-pass", "20"], "leaves nothing below"),
        (["--stroke", "nan"], "position_limit = nan is not a finite number"),
        (["--table", "bergam"], "did you mean 'bergamo'"),
        (["--out", "result.txt"], "give a name that ends in .csv or .yaml"),
        (["--stroke", "wide"], "invalid float value"),
    ],
)
def test_bad_arguments_give_one_line_and_exit_code_2(
    record: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    code, _, err = run(capsys, record, *arguments)
    assert code == 2
    assert message in err
    assert "Traceback" not in err


def test_a_file_that_is_no_record_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "letter.txt"
    path.write_text("Dear reader,\n")
    code, out, err = run(capsys, path, "--out", tmp_path / "scaled.csv")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert str(path) in err
    assert not (tmp_path / "scaled.csv").exists()
