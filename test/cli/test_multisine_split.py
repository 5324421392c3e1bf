"""multisine_split on recordings whose parts are known."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from shake_ros import __main__ as shake_ros
from shake_ros.recordings.bags import write_table_recording


def main(arguments: list[str]) -> int:
    return shake_ros.main(["multisine_split", *arguments])


N = 2000
TURN = 2.0 * np.pi * np.arange(N) / N
COMMAND = np.tile(0.2 * (np.cos(3.0 * TURN) + np.cos(7.0 * TURN) + np.sin(9.0 * TURN)), 4)
TIME = np.arange(4 * N) * 0.001


def record(folder: Path, acceleration: np.ndarray, name: str = "bag", command: np.ndarray = COMMAND) -> str:
    arrays = {"time": TIME, "valve_command": command, "position": 0.01 * COMMAND, "acceleration": acceleration}
    return str(write_table_recording(folder / name, **arrays))


def printed(text: str) -> dict[str, float]:
    return {name: float(value) for name, value in re.findall(r"^(linear|even|odd|noise) +([\d.]+) ", text, re.M)}


def test_parts_of_a_known_mixture_are_printed(tmp_path, capsys):
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(TIME))
    bag = record(tmp_path, 10.0 * COMMAND + 8.0 * COMMAND**2 + noise)
    assert main([bag, "--period", "2"]) == 0
    parts = printed(capsys.readouterr().out)
    assert parts["linear"] == pytest.approx(10.0 * np.std(COMMAND), rel=0.01)
    assert parts["even"] == pytest.approx(8.0 * np.std(COMMAND**2), rel=0.05)
    assert parts["noise"] == pytest.approx(0.05, rel=0.1)


def test_the_period_is_found(tmp_path, capsys):
    assert main([record(tmp_path, 3.0 * COMMAND)]) == 0
    assert "3 periods of 2 s, 3 excited lines from 1.5 to 4.5 Hz" in capsys.readouterr().out


def test_the_figure_is_drawn_and_never_overwritten(tmp_path, capsys):
    bag, plot = record(tmp_path, 3.0 * COMMAND), tmp_path / "lines.png"
    assert main([bag, "--plot", str(plot)]) == 0
    first = plot.read_bytes()
    assert first.startswith(b"\x89PNG")
    assert main([bag, "--plot", str(plot)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert plot.read_bytes() == first
    assert main([bag, "--plot", str(plot), "--force"]) == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--period", "1.3"], "does not repeat"),
        (["--period", "0.00151"], "not a whole number"),
        (["--period", "-1"], "not a length"),
        (["--period", "100"], "no whole period"),
    ],
)
def test_a_wrong_period_is_one_clear_line(tmp_path, capsys, arguments, told):
    assert main([record(tmp_path, 3.0 * COMMAND), *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and told in error


def test_a_command_that_does_not_repeat_is_one_clear_line(tmp_path, capsys):
    sweep = 0.2 * np.sin(2.0 * np.pi * (0.5 + 0.3 * TIME) * TIME)
    assert main([record(tmp_path, 3.0 * sweep, command=sweep)]) == 2
    assert "does not repeat itself" in capsys.readouterr().err
