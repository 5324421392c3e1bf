"""The motion that decides, on a running table: released by name, played, recorded where the results are."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from live_tables import LIMITS, SimulatedLiveTable

from shake_ros.cli import repair
from shake_ros.iteration.drive import integrate
from shake_ros.settings import load_table


def motion(sample_time: float) -> np.ndarray:
    """Half a second that begins and ends at rest, (n, 3)."""
    t = np.arange(0.0, 0.5, sample_time)
    return integrate(np.gradient(np.gradient(2e-3 * (t * (0.5 - t) / 0.0625) ** 4, t), t), sample_time)


class Series:
    """What `decide` does with the motions that it designs, two of them."""

    def __init__(self) -> None:
        self.recordings: list[object] = []
        self.options: dict[str, object] = {}

    def __call__(self, found: object, play, most: int, **options: object) -> SimpleNamespace:
        self.options = options
        asked = SimpleNamespace(lines=lambda: ["the next recording: a pulse"], motion_at=motion)
        self.recordings = [play(asked) for _ in range(most)]
        return SimpleNamespace(played=(), last=SimpleNamespace(lines=lambda: ["settled"]))


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Decide on a live table; the series, and the folder of the results."""

    def call(acknowledge: str, held_at: float = 0.0) -> tuple[Series, Path]:
        series, table = Series(), SimulatedLiveTable(load_table("bergamo"), tmp_path, held_at)
        monkeypatch.setattr(repair, "decide", series)
        monkeypatch.setattr(repair, "live", lambda given: contextlib.nullcontext(table))
        given = argparse.Namespace(out=tmp_path / "out", acknowledge=acknowledge, most=2, minutes=None, force=False)
        repair.decide_live(SimpleNamespace(), given, [])
        return series, given.out / "recordings"

    return call


def test_each_released_motion_is_played_and_kept(run, capsys: pytest.CaptureFixture[str]) -> None:
    series, folder = run("me")
    assert [r.names for r in series.recordings] == [("next_1",), ("next_2",)]
    assert all((folder / name / "metadata.yaml").is_file() for name in ("next_1", "next_2"))
    assert series.options["interlock"] == LIMITS
    output = capsys.readouterr().out
    assert "a pulse" in output and "live, simulated, lock-step" in output and "settled" in output


def test_without_a_release_nothing_moves(run, capsys: pytest.CaptureFixture[str]) -> None:
    series, folder = run("")
    assert series.recordings == [None, None]
    assert not folder.exists()
    assert "nobody released it" in capsys.readouterr().out


def test_a_hold_of_the_interlock_ends_the_series_in_one_line(run, capsys: pytest.CaptureFixture[str]) -> None:
    series, folder = run("me", held_at=0.5)
    assert series.recordings == [None, None]
    assert not folder.exists()
    assert "the interlock held the table: velocity 0.3 beyond 0.2 m/s; the search ends" in capsys.readouterr().err
