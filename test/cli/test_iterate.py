"""The command iterate: what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from shake_ros.__main__ import main

GIVEN = ["iterate", "--wanted", "earthquake_rock", "--out"]


def test_neither_or_both_sources_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = [*GIVEN, str(tmp_path / "out")]
    assert main(given) == 2
    assert main([*given, "bag", "--simulate", "2"]) == 2
    assert capsys.readouterr().err.count("give either recordings or --simulate N") == 2
    assert not (tmp_path / "out").exists()


def test_refit_needs_a_model_and_known_effects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = [*GIVEN, str(tmp_path / "out"), "--simulate", "2"]
    assert main([*given[:-2], "bag", "--refit", "soft_zone"]) == 2
    assert "bag" in capsys.readouterr().err
    assert main([*given, "--model", "bergamo", "--refit", "soft_zome"]) == 2
    assert "soft_zome" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
