"""thd: recordings whose harmonics are known, and recordings that have none."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from shake_ros import __main__ as shake_ros
from shake_ros.recordings.bags import write_table_recording


def main(arguments: list[str]) -> int:
    return shake_ros.main(["thd", *arguments])


TIME = np.arange(8000) * 0.001
FREQUENCY = 2.137
TURN = 2.0 * np.pi * FREQUENCY * TIME
ACCELERATION = 3.0 * np.sin(TURN + 0.5) + 0.6 * np.sin(3.0 * TURN) + 0.3 * np.sin(5.0 * TURN)
KNOWN = 100.0 * math.hypot(0.6, 0.3) / 3.0


def record(folder: Path, name: str = "bag", **changes: object) -> Path:
    arrays = {"time": TIME, "valve_command": 0.3 * np.sin(TURN), "position": 0.01 * np.cos(TURN)}
    arrays |= {"acceleration": ACCELERATION, **changes}
    return write_table_recording(folder / name, **arrays)


def printed_thd(text: str) -> list[float]:
    return [float(value) for value in re.findall(r"^THD +([\d.]+) %", text, re.MULTILINE)]


def refusal(bag: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main([str(bag), *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.count("\n") == 1
    return output.err


def test_harmonics_of_a_recording_stand_in_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(record(tmp_path))]) == 0
    text = capsys.readouterr().out
    assert printed_thd(text) == [pytest.approx(KNOWN, abs=2e-3)]
    rows = [line.split() for line in text.splitlines() if re.match(r" +\d+  ", line)]
    assert len(rows) == 15
    assert [float(rows[k][2]) for k in (0, 1, 2, 4)] == pytest.approx([3.0, 0.0, 0.6, 0.3], abs=1e-5)
    assert re.search(rf"fundamental {FREQUENCY} Hz \((fitted to the acceleration near {FREQUENCY} Hz )?of valve_", text)


def test_several_recordings_are_tables_one_by_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = record(tmp_path, "other", acceleration=2.0 * np.sin(TURN))
    assert main([str(record(tmp_path)), str(other), "--harmonics", "7"]) == 0
    assert printed_thd(capsys.readouterr().out) == pytest.approx([KNOWN, 0.0], abs=2e-3)


def test_ramps_of_the_reference_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    envelope = np.interp(TIME, [0.0, 1.5, 6.5, 8.0], [0.0, 1.0, 1.0, 0.0])
    reference = np.column_stack([envelope * np.sin(TURN)] * 3)
    bag = record(tmp_path, acceleration=envelope * ACCELERATION, reference=reference)
    assert main([str(bag)]) == 0
    text = capsys.readouterr().out
    assert re.search(r"of reference\)", text)
    assert printed_thd(text) == [pytest.approx(KNOWN, abs=2e-3)]


def test_fundamental_is_fitted_where_the_command_has_another_clock(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A minute, in which 3 mHz are a fifth of a period; noise between the harmonics agrees with both distortions."""
    time, f = np.arange(60000) / 1000.0, 5.003
    felt = 5.0 * np.sin(2.0 * np.pi * f * time) + 0.25 * np.sin(2.0 * np.pi * 3.0 * f * time + 0.3)
    arrays = {"time": time, "valve_command": 0.3 * np.sin(2.0 * np.pi * 5.0 * time), "position": 0.0 * time}
    bag = record(tmp_path, acceleration=felt, **arrays)
    assert main([str(bag)]) == 0
    text = capsys.readouterr().out
    assert "fundamental 5.003 Hz (fitted to the acceleration near 5 Hz of valve_command, +600 ppm off" in text
    assert re.search(r"^ +1 +5\.0030 +5\.000000 ", text, re.MULTILINE)
    assert printed_thd(text) == [pytest.approx(5.0, abs=1e-3)]
    assert "THD and noise  5.000 %" in text
    assert "noise          0.000000 m/s² rms" in text
    assert main([str(bag), "--frequency", "5"]) == 0
    assert (
        "fundamental 5.003 Hz (fitted to the acceleration near 5 Hz as given, +600 ppm off" in capsys.readouterr().out
    )


def test_the_window_can_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    late = np.where(TIME < 4.0, 5.0 * np.sin(2.0 * TURN), ACCELERATION)
    assert main([str(record(tmp_path, acceleration=late)), "--start", "4.1", "--stop", "7.9"]) == 0
    assert printed_thd(capsys.readouterr().out) == [pytest.approx(KNOWN, abs=2e-3)]


def test_the_fundamental_can_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = record(tmp_path, valve_command=np.zeros_like(TIME))
    assert "name the fundamental with --frequency" in refusal(bag, capsys)
    assert main([str(bag), "--frequency", str(FREQUENCY), "--start", "0"]) == 0
    assert printed_thd(capsys.readouterr().out) == [pytest.approx(KNOWN, abs=2e-3)]


def test_a_recording_without_an_accelerometer_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no topic imu" in refusal(record(tmp_path, acceleration=None), capsys)


def test_a_command_that_is_not_periodic_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, len(TIME))
    assert "is not periodic" in refusal(record(tmp_path, valve_command=noise), capsys)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("--start", "20"), "nothing between 20 and inf s"),
        (("--frequency", "900"), "half the sampling rate"),
        (("--frequency", "0"), "no whole period of 0 Hz"),
        (("--frequency", "-2"), "no whole period of -2 Hz"),
        (("--harmonics", "0"), "needs at least 1"),
        (("--start", "7.9", "--frequency", "2"), "0 whole periods"),
    ],
)
def test_arguments_that_fit_no_recording_are_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], reason: str
) -> None:
    text = refusal(record(tmp_path), capsys, *arguments)
    assert reason in text
    assert "bag:" in text


def test_a_folder_that_is_no_recording_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert str(tmp_path) in refusal(tmp_path, capsys)


def test_unknown_arguments_exit_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    for argument, code in (("--loud", 2), ("--help", 0)):
        with pytest.raises(SystemExit) as stop:
            main([argument])
        assert stop.value.code == code
