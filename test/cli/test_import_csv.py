"""import_csv: tables of laboratories, with their separators, headers, units and mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shake_ros.cli.import_csv import main
from shake_ros.core.quantities import ShakeError
from shake_ros.data.recordings import read_table_recording

TABLE = "t,u,x_mm,a\n" + "".join(f"{0.01 * k:.2f},{0.1 * k:.1f},{k},{k + 0.5}\n" for k in range(5))


def run(tmp_path: Path, text: str, *arguments: str, columns: str = "--time t --command u --position x_mm*1e-3"):
    file = tmp_path / "table.csv"
    file.write_text(text, encoding="utf-8")
    assert main([str(file), *columns.split(), *arguments, "--out", str(tmp_path / "bag")]) == 0
    return read_table_recording(tmp_path / "bag")


def test_columns_are_read_by_name_and_scaled_to_si(tmp_path):
    recording = run(tmp_path, TABLE, "--acceleration", "a", "--force", "x_mm*100")
    assert np.allclose(recording.position, 0.001 * np.arange(5), rtol=1e-15)
    assert np.allclose(recording.valve_command, 0.1 * np.arange(5), rtol=1e-15)
    assert np.array_equal(recording.acceleration, np.arange(5) + 0.5)
    assert np.array_equal(recording.force, 100.0 * np.arange(5))
    assert recording.sample_time == 0.01


@pytest.mark.parametrize(
    "text",
    [
        TABLE.replace(",", ";"),
        TABLE.replace(",", "\t"),
        TABLE.replace(",", "   "),
        TABLE.replace(",", ";").replace(".", ","),  # decimal comma
        TABLE.replace("\n", "\r\n"),
        "\ufeff" + TABLE,
        "Rig 3, by hand\nDate: 2022-06-29\n\n" + TABLE,
        '"t","u","x_mm","a"\n' + TABLE.split("\n", 1)[1],
    ],
)
def test_separator_header_and_decimal_comma_are_found(tmp_path, text):
    assert np.allclose(run(tmp_path, text).valve_command, 0.1 * np.arange(5), rtol=1e-15)


def test_columns_go_by_number_where_there_are_no_names(tmp_path):
    bare = TABLE.split("\n", 1)[1]
    recording = run(tmp_path, bare, columns="--time 1 --command 2 --position 3*0.001")
    assert np.allclose(recording.position, 0.001 * np.arange(5), rtol=1e-15)


def test_a_rate_stands_in_for_a_missing_time_column(tmp_path):
    recording = run(tmp_path, TABLE, columns="--rate 200 --command u --position x_mm*1e-3")
    assert recording.sample_time == 0.005


def test_skipped_lines_are_not_looked_at(tmp_path):
    text = "1,2,3,4\n5,6,7,8\n" + TABLE
    assert len(run(tmp_path, text, "--skip", "2")) == 5


def test_empty_cells_end_a_segment(tmp_path, capsys):
    recording = run(tmp_path, TABLE.replace("0.02,0.2,", "0.02,,"))
    assert recording.segments == (slice(0, 2), slice(3, 5))
    assert "no finite value" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "columns", "words"),
    [
        (TABLE, "--time t --command v --position x_mm", r"unknown column 'v'.*known: a, t, u, x_mm"),
        (TABLE, "--time t --command 9 --position x_mm", "no column 9, the table has 4 columns"),
        (TABLE, "--rate 0 --command u --position x_mm", "--rate 0"),
        (TABLE, "--time t --command u*0 --position x_mm", "scale"),
        (
            TABLE.replace("0.3,", "off,"),
            "--time t --command u --position x_mm",
            "line 5, column 'u' holds 'off', not a number",
        ),
        (TABLE * 2, "--time t --command u --position x_mm", "line 7, column 't' holds 't', not a number"),
        (TABLE.replace("0.03", "0.01"), "--time t --command u --position x_mm", "does not rise at row 4"),
        (TABLE.split("\n", 1)[1], "--time t --command u --position x_mm", "no line of names"),
        ("", "--time t --command u --position x_mm", "no rows of numbers"),
        (TABLE + "0.05,1", "--time t --command u --position x_mm", "line 7 has 2 columns, 3 are needed"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing_behind(tmp_path, text, columns, words):
    with pytest.raises(ShakeError, match=words):
        run(tmp_path, text, columns=columns)
    assert not (tmp_path / "bag").exists()


def test_an_existing_recording_stays_without_overwrite(tmp_path):
    run(tmp_path, TABLE)
    with pytest.raises(ShakeError, match="exists already"):
        run(tmp_path, TABLE)
    assert len(run(tmp_path, TABLE + "0.05,0,0,0\n", "--overwrite")) == 6


def test_every_run_of_the_electric_table_is_imported(shared, tmp_path):
    files = sorted((shared / "data/electric_table").glob("*.csv"))
    assert len(files) == 14
    for file in files:
        out = tmp_path / file.stem
        columns = "--time t_s --command ut --position position*0.001"
        assert main([str(file), *columns.split(), "--out", str(out)]) == 0
        recording = read_table_recording(out)
        expected = np.loadtxt(file, delimiter=",", skiprows=1)
        assert recording.sample_time == 0.005
        assert recording.segments == (slice(0, len(expected)),)
        assert np.array_equal(recording.valve_command, expected[:, 2])


@pytest.mark.parametrize(("name", "count"), [("chirp_0A.txt", 61500), ("chirp_1A.txt", 59100)])
def test_the_servo_hydraulic_actuator_is_imported_with_its_force(shared, tmp_path, name, count):
    columns = "--rate 1000 --command CHANNEL2*0.01 --position CHANNEL0*0.01 --force CHANNEL1*9806.65"
    file = shared / "data/mts_actuator" / name
    assert main([str(file), *columns.split(), "--out", str(tmp_path / "bag")]) == 0
    recording = read_table_recording(tmp_path / "bag")
    assert len(recording) == count
    assert recording.force is not None
    expected = np.genfromtxt(file, delimiter=",", skip_header=7, usecols=(2, 3), comments=None)
    assert np.allclose(recording.position, 0.01 * expected[:, 0], rtol=1e-15)
    assert np.allclose(recording.force, 9806.65 * expected[:, 1], rtol=1e-15)
