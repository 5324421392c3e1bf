"""The command iterate: what it refuses, and that the drive it writes is played as it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shake_ros.cli import iterate
from shake_ros.core.iteration.drive import integrate
from shake_ros.data.reference_program import build_program


def test_written_drive_is_the_reference_that_is_played(tmp_path: Path) -> None:
    drive = np.array(build_program("earthquake_rock", 0.001).states)
    drive = integrate(1.1 * drive[:, 2], 0.001)
    iterate._write(tmp_path, tmp_path, drive, 0.001, [0.5])
    played = build_program(str(tmp_path / "drive.yaml"), 0.001).states
    assert len(played) == len(drive)
    np.testing.assert_allclose(played[:, 2], drive[:, 2], atol=1e-3)  # of 5 m/s²
    np.testing.assert_allclose(played[:, 0], drive[:, 0], atol=2e-4)  # the mean and the ends are taken out once more


def test_neither_or_both_sources_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--wanted", "earthquake_rock", "--out", str(tmp_path / "out")]
    assert iterate.main(given) == 2
    assert iterate.main([*given, "bag", "--simulate", "2"]) == 2
    assert capsys.readouterr().err.count("give either recordings or --simulate N") == 2
    assert not (tmp_path / "out").exists()


def test_refit_needs_a_model_and_known_effects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--wanted", "earthquake_rock", "--out", str(tmp_path / "out"), "--simulate", "2"]
    assert iterate.main([*given, "--refit", "soft_zone"]) == 2
    assert "--refit: needs --model" in capsys.readouterr().err
    assert iterate.main([*given, "--model", "bergamo", "--refit", "soft_zome"]) == 2
    assert "soft_zome" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
