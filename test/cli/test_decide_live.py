"""The motion that decides, on a running table: released by name, played, recorded where the results are."""

from __future__ import annotations

import argparse
import contextlib
import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from live_tables import SimulatedLiveTable

from shake_ros.cli import arguments, repair
from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.settings import load_table


def motion(sample_time: float) -> np.ndarray:
    """Half a second that begins and ends at rest, (n, 3)."""
    t = np.arange(0.0, 0.5, sample_time)
    return states_from_rest(np.gradient(np.gradient(2e-3 * (t * (0.5 - t) / 0.0625) ** 4, t), t), sample_time)


class Answer:
    """A result that says where it is reported. reported : whether it was yet."""

    reported = False

    def report(self, folder: Path, **_: object) -> Path:
        self.reported = True
        return folder


class Series:
    """What `decide` does with the motions that it designs, two of them, each with an answer."""

    def __init__(self) -> None:
        self.recordings: list[object] = []
        self.options: dict[str, object] = {}
        self.designed: list[Path] = []

    def __call__(self, found: object, play, most: int, extended, **options: object) -> SimpleNamespace:
        self.options = options
        asked = SimpleNamespace(lines=lambda: ["the next recording: a pulse"], motion_at=motion)
        for _ in range(most):
            self.recordings.append(play(asked))
            if self.recordings[-1]:
                extended(answer := Answer())
                assert answer.reported  # before the table moves again
        return SimpleNamespace(played=(), last=SimpleNamespace(lines=lambda: ["settled"]))


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Decide on a live table; the series, and the folder of the results."""

    def call(acknowledge: str, held_at: float = 0.0) -> tuple[Series, Path]:
        series, table = Series(), SimulatedLiveTable(load_table("bergamo"), tmp_path, held_at)
        monkeypatch.setattr(repair, "decide", series)
        monkeypatch.setattr(repair, "write_next", lambda _, out: series.designed.append(out.relative_to(tmp_path)))
        monkeypatch.setattr(repair, "live", lambda given: contextlib.nullcontext(table))
        given = argparse.Namespace(out=tmp_path / "out", acknowledge=acknowledge, most=2, minutes=None, force=False)
        given.figures, given.line = None, ""
        repair.decide_live([Answer()], given)
        return series, given.out / "recordings"

    return call


def test_each_released_motion_is_played_and_kept(run, capsys: pytest.CaptureFixture[str]) -> None:
    series, folder = run("me")
    assert [r.names for r in series.recordings] == [("next_1",), ("next_2",)]
    assert all((folder / name / "metadata.yaml").is_file() for name in ("next_1", "next_2"))
    acting = set(series.options["interlock"].limits)
    assert acting == {"stop", "position_hard", "position_soft", "velocity", "acceleration"}
    assert series.designed == [Path("out"), Path("out/decided"), Path("out/decided")]
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


def test_a_process_that_is_followed_asks_it_for_the_release(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(arguments, "FOLLOWED", True)
    monkeypatch.setattr("sys.stdin", io.StringIO("Anna\n"))
    assert arguments.released_by("1.5 mm\nat 2 Hz", "") == "Anna"
    assert capsys.readouterr().out.splitlines()[-1] == 'release\t"1.5 mm\\nat 2 Hz"'
    assert arguments.released_by("1.5 mm", "") == ""  # nobody is left to answer
    assert arguments.released_by("1.5 mm", "Bert") == "Bert"
