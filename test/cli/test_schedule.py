"""`schedule` refuses what it cannot use, in one line and before the work."""

from __future__ import annotations

from pathlib import Path

import pytest

from shake_ros.__main__ import main
from shake_ros.settings import load_content, load_table
from shake_ros.thesis.network import pieces
from shake_ros.thesis.schedule import KEYS, simulated


@pytest.mark.parametrize(
    ("more", "text"),
    [(["--learn", "somewhere"], "both or neither"), (["--config", "nowhere"], "nowhere")],
)
def test_bad_arguments_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list, text: str) -> None:
    assert main(["schedule", "--out", str(tmp_path / "out"), *more]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_simulated_data_are_windows_to_learn_from_and_a_doubled_amplitude_to_validate() -> None:
    settings = load_content("schedule", "default", KEYS)[0]
    short = settings | {"amplitudes": [0.1, 0.3], "frequencies": [2.0]}
    learn, hold = simulated(short, load_table(settings["table"]))
    assert len(pieces(learn)) == 2
    doubled = hold[0].commands
    at = round(settings["doubling"]["at"] / settings["sample_time"])
    assert abs(doubled[at:]).max() == pytest.approx(2.0 * abs(doubled[:at]).max(), rel=1e-3)
