"""import_csv: tables of laboratories, with their separators, headers, units and mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shake_ros.cli.repair import import_csv_command
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import read_table_recording

TABLE = "t,u,x_mm,a\n" + "".join(f"{0.01 * k:.2f},{0.1 * k:.1f},{k},{k + 0.5}\n" for k in range(5))


def run(tmp_path: Path, text: str, *arguments: str, columns: str = "--time t --command u --position x_mm*1e-3"):
    file = tmp_path / "table.csv"
    file.write_text(text, encoding="utf-8")
    assert import_csv_command([str(file), *columns.split(), *arguments, "--out", str(tmp_path / "bag")]) == 0
    return read_table_recording(tmp_path / "bag")


def test_columns_are_read_by_name_and_scaled_to_si(tmp_path):
    recording = run(tmp_path, TABLE, "--acceleration", "a", "--force", "x_mm*100")
    assert np.allclose(recording.position, 0.001 * np.arange(5), rtol=1e-15)
    assert np.allclose(recording.valve_command, 0.1 * np.arange(5), rtol=1e-15)
    assert np.array_equal(recording.acceleration, np.arange(5) + 0.5)
    assert np.array_equal(recording.force, 100.0 * np.arange(5))
    assert recording.sample_time == 0.01


def test_an_acceleration_may_stand_in_for_the_position(tmp_path, capsys):
    recording = run(tmp_path, TABLE, columns="--time t --command u --acceleration a")
    assert not recording.position_measured
    assert "joint_states" not in recording.provenance.topics
    assert recording.segments == (slice(0, 5),)
    assert recording.sample_time == 0.01
    assert np.allclose(recording.valve_command, 0.1 * np.arange(5), rtol=1e-15)
    assert np.array_equal(recording.acceleration, np.arange(5) + 0.5)
    assert "no position was recorded" in capsys.readouterr().out


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
        (TABLE * 2, "--time t --command u --position x_mm", "time does not rise at row 6"),
        (TABLE.replace("0.03", "0.01"), "--time t --command u --position x_mm", "does not rise at row 4"),
        (TABLE.split("\n", 1)[1], "--time t --command u --position x_mm", "no line of names"),
        ("", "--time t --command u --position x_mm", "is empty"),
        ("Dear reader", "--time t --command u --position x_mm", "no rows of numbers"),
        (TABLE + "0.05,1", "--time t --command u --position x_mm", "line 7 has 2 columns, 3 are needed"),
        (TABLE, "--time t --command u --force a", "--position or --acceleration is needed"),
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
        assert import_csv_command([str(file), *columns.split(), "--out", str(out)]) == 0
        recording = read_table_recording(out)
        expected = np.loadtxt(file, delimiter=",", skiprows=1)
        assert recording.sample_time == 0.005
        assert recording.segments == (slice(0, len(expected)),)
        assert np.array_equal(recording.valve_command, expected[:, 2])


@pytest.mark.parametrize(("name", "count"), [("chirp_0A.txt", 61500), ("chirp_1A.txt", 59100)])
def test_the_servo_hydraulic_actuator_is_imported_with_its_force(shared, tmp_path, name, count):
    columns = "--rate 1000 --command CHANNEL2*0.01 --position CHANNEL0*0.01 --force CHANNEL1*9806.65"
    file = shared / "data/mts_actuator" / name
    assert import_csv_command([str(file), *columns.split(), "--out", str(tmp_path / "bag")]) == 0
    recording = read_table_recording(tmp_path / "bag")
    assert len(recording) == count
    assert recording.force is not None
    expected = np.genfromtxt(file, delimiter=",", skip_header=7, usecols=(2, 3), comments=None)
    assert np.allclose(recording.position, 0.01 * expected[:, 0], rtol=1e-15)
    assert np.allclose(recording.force, 9806.65 * expected[:, 1], rtol=1e-15)


ROWS = np.arange(2000) / 250.0
WAVES = np.random.default_rng(2).uniform(1.5, 12.0, 30)  # [Hz]


def swung(time: np.ndarray, derivative: int = 0) -> np.ndarray:
    w = 2.0 * np.pi * WAVES
    return np.asarray(np.sin(np.outer(time, w) + 3.0 * w) @ (1e-3 / w * (-(w**2) if derivative else 1.0)))


def text_of(**columns: np.ndarray) -> str:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join("" if v != v else f"{v:.9g}" for v in row) for row in rows)]) + "\n"


def test_a_column_may_have_an_offset(tmp_path):
    text = text_of(t=ROWS, mA=12.0 + 8.0 * np.sin(ROWS), x=ROWS)
    recording = run(tmp_path, text, columns="--time t --command mA*0.125-1.5 --position x")
    assert np.allclose(recording.valve_command, np.sin(ROWS), atol=1e-8)


def test_the_load_pressure_of_one_transducer_or_of_two_is_said_to_be_fitted(tmp_path, capsys):
    recording = run(tmp_path, TABLE, "--pressure_a", "a*1e5", "--pressure_supply", "u*1e5+2e7")
    assert np.allclose(recording.pressure_a, 1e5 * (np.arange(5) + 0.5))
    assert np.allclose(recording.pressure_supply, 2e7 + 1e4 * np.arange(5))
    assert recording.load is None
    assert "load pressure" not in capsys.readouterr().out
    both = run(tmp_path, TABLE, "--pressure_a", "a*1e5", "--pressure_b", "u*1e5", "--overwrite")
    one = run(tmp_path, TABLE, "--pressure_load", "a*1e5", "--overwrite")
    assert np.allclose(both.load, both.pressure_a - both.pressure_b)
    assert np.allclose(one.load, 1e5 * (np.arange(5) + 0.5))
    assert capsys.readouterr().out.count("load pressure: identify and close_loop fit it as well") == 2


def test_rows_that_are_there_twice_are_left_out_and_reported(tmp_path, capsys):
    first, second, *rest = TABLE.splitlines(keepends=True)
    recording = run(tmp_path, "".join([first, second, second, *rest]))
    assert np.allclose(recording.valve_command, 0.1 * np.arange(5))
    assert "1 rows are repeated" in capsys.readouterr().out


def test_short_gaps_are_filled_where_that_is_asked_for(tmp_path, capsys):
    missing = np.isin(np.arange(2000), [500, 900, 901])
    text = text_of(t=ROWS[~missing], u=np.sin(ROWS)[~missing], x=swung(ROWS)[~missing])
    columns = "--time t --command u --position x"
    assert len(run(tmp_path, text, columns=columns).segments) == 3
    assert "--bridge 2 fills them" in capsys.readouterr().out
    recording = run(tmp_path, text, "--bridge", "2", "--overwrite", columns=columns)
    assert recording.segments == (slice(0, 2000),)
    assert np.allclose(recording.position, swung(ROWS), atol=1e-6)
    assert "3 samples in 2 gaps of up to 2 samples are filled" in capsys.readouterr().out


def test_stamps_that_jitter_by_a_third_of_a_period_part_nothing(tmp_path):
    late = ROWS + np.random.default_rng(1).uniform(-0.3, 0.3, 2000) / 250.0
    recording = run(
        tmp_path, text_of(t=late, u=np.sin(ROWS), x=swung(ROWS)), columns="--time t --command u --position x"
    )
    assert recording.segments == (slice(0, 2000),)
    assert recording.sample_time == pytest.approx(0.004, rel=1e-4)


def second_file(tmp_path: Path, **columns: np.ndarray) -> list[str]:
    (tmp_path / "imu.csv").write_text(text_of(**columns), encoding="utf-8")
    return ["--also", str(tmp_path / "imu.csv"), "--time", "ts", "--acceleration", "a*10"]


def test_a_second_file_is_put_on_the_clock_of_the_first(tmp_path, capsys):
    own = np.arange(0.0, 6.0, 1.0 / 480.0)  # its clock is 50 ppm fast and shows 70 s at 1.302 s of the first file
    behind = second_file(tmp_path, ts=70.0 + own, a=0.1 * swung(1.302 + own / (1.0 + 50e-6), 2))
    text = text_of(t=ROWS, u=np.sin(ROWS), x=swung(ROWS))
    recording = run(tmp_path, text, *behind, columns="--time t --command u --position x")
    begin = ROWS[np.argmax(ROWS >= 1.302)]
    assert recording.position[0] == pytest.approx(swung(np.array([begin]))[0], abs=1e-9)
    true = swung(begin + recording.time, 2)
    assert np.sqrt(np.mean((recording.acceleration - true) ** 2)) < 0.01 * np.std(true)
    said = capsys.readouterr().out
    assert "imu.csv: begins 1.302" in said
    assert " ppm fast" in said


def test_the_time_of_a_second_file_may_be_that_of_the_first(tmp_path):
    behind = second_file(tmp_path, ts=ROWS[100:1900], a=0.1 * np.sin(3.0 * ROWS[100:1900]))
    text = text_of(t=ROWS, u=np.sin(ROWS), x=np.sin(3.0 * ROWS))
    recording = run(tmp_path, text, *behind, "--same-clock", columns="--time t --command u --position x")
    assert len(recording) == 1800
    assert np.allclose(recording.acceleration, np.sin(3.0 * ROWS[100:1900]), atol=1e-6)


@pytest.mark.parametrize(
    ("second", "columns", "words"),
    [
        ("noise", "--time t --command u --position x", "imu.csv: its acceleration does not relate its clock"),
        ("sine", "--time t --command u --position s", "periodic motion"),
        ("noise", "--time t --command u --position x --acceleration x", "the acceleration is in the first file"),
        ("noise", "--time t --command u", "without a position the clock of .*imu.csv cannot be related to it"),
    ],
)
def test_files_that_cannot_be_put_together_are_refused_in_a_line(tmp_path, second, columns, words):
    felt = {"noise": np.random.default_rng(3).standard_normal(2000), "sine": np.sin(12.0 * ROWS)}[second]
    text = text_of(t=ROWS, u=np.sin(ROWS), x=swung(ROWS), s=np.sin(12.0 * ROWS))
    with pytest.raises(ShakeError, match=words) as refused:
        run(tmp_path, text, *second_file(tmp_path, ts=ROWS, a=felt), columns=columns)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "bag").exists()
