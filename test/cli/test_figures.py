"""The command that draws the thesis's figures again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from shake_ros import __main__ as shake_ros
from shake_ros.thesis import figures_laws


def main(arguments: list[str]) -> int:
    return shake_ros.main(["figures", *arguments])


@pytest.mark.parametrize("name", ["2.4", "2.5"])
def test_a_figure_is_drawn_into_the_folder(tmp_path: Path, name: str) -> None:
    assert main([name, "--out", str(tmp_path / "new")]) == 0
    (picture,) = (tmp_path / "new").glob("*.png")
    assert picture.name == f"figure_{name.replace('.', '_')}.png"
    assert np.ptp(imread(picture)) > 0.5


def test_figure_2_4_shows_four_models_for_each_air_content() -> None:
    figure = figures_laws.entrained_air()
    assert [len(axes.lines) for axes in figure.axes] == [4, 4, 4, 4]
    low = [axes.lines[0].get_ydata()[50] for axes in figure.axes]  # type: ignore[index]
    assert np.all(np.diff(low) < 0.0)  # the more air, the softer


def test_nothing_is_overwritten_without_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "figure_2_5.png"
    target.write_bytes(b"mine")
    assert main(["2.5", "--out", str(tmp_path)]) == 2
    assert target.read_bytes() == b"mine"
    assert "figure_2_5.png: exists already" in capsys.readouterr().err
    assert main(["2.5", "--out", str(tmp_path), "--force"]) == 0
    assert target.stat().st_size > 1000


def test_an_unknown_figure_is_one_line_and_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["9.9", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "unknown figure '9.9'" in said
    assert not list(tmp_path.iterdir())
