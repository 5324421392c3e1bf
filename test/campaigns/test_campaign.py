"""The command campaign: goes on where it stopped, says what is wrong in a line, shows what was found."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shake_ros.__main__ import main
from shake_ros.campaigns import campaign as face

STUDY = """
title: Sums of random numbers
measure: benchmarks.campaign.tasks:{function}
rows:
  - size: [100, 200]
    seed: {{first: 1, last: 30}}
report:
  - shares: [even]
    title: Even seeds
    by: [size]
  - matrix: {{truth: size, named: even}}
  - spread: {{trace of the product: trace}}
    by: [size]
  - rate: {{events: even, over: size}}
    by: [size]
"""


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "sums.yaml"
    path.write_text(STUDY.format(function="sums"))
    return path


@pytest.fixture
def processes(monkeypatch):
    """How often an engine was started."""
    started = []
    real = face.engine
    monkeypatch.setattr(face, "engine", lambda *given: started.append(given) or real(*given))
    return started


def rows(folder: Path) -> dict[str, str]:
    base = sqlite3.connect(folder / "rows.sqlite")
    found = base.execute("SELECT given, figures FROM rows").fetchall()
    base.close()
    assert len(found) == len(dict(found))
    return dict(found)


def test_a_study_is_run_once_and_then_only_shown(study, tmp_path, processes, capsys):
    out = tmp_path / "out"
    assert main(["campaign", str(study), "--out", str(out), "--workers", "1"]) == 0
    first, printed = rows(out), capsys.readouterr().out
    assert len(first) == 60
    assert "15 3000 0.5 0.28 0.825" in " ".join(printed.split())  # Garwood's interval for 15 events
    assert "60 of 60  rows" in printed and "50.0 % of 30 (33.2 … 66.8 %)" in printed
    assert main(["campaign", str(study), "--out", str(out), "--compare", str(out)]) == 0
    assert rows(out) == first
    assert len(processes) == 1
    page = (out / "report.html").read_text()
    assert "60 rows are in both; 60 are the same to the last bit." in page
    assert "Even seeds" in page and "core-hours" in page


def test_stopped_by_ctrl_c_it_keeps_what_it_has_and_goes_on_with_the_rest(tmp_path):
    study, out = tmp_path / "held.yaml", tmp_path / "out"
    study.write_text(
        "title: Held\nmeasure: benchmarks.campaign.tasks:held\n"
        f"rows: [{{seed: {{first: 1, last: 60}}, first: [40], folder: ['{tmp_path}']}}]\n"
    )
    command = [sys.executable, "-m", "shake_ros", "campaign", str(study), "--out", str(out), "--workers", "1"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a child of tests in the background ignores it
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True)
    signal.signal(signal.SIGINT, before)
    deadline = time.monotonic() + 240.0
    while time.monotonic() < deadline and not (out.exists() and _count(out) > 5):
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers as well
    _, errors = process.communicate(timeout=120.0)
    assert process.returncode == 130
    assert errors.splitlines()[-1] == f"stopped; finished rows are in {out}, and the same command continues"
    assert "Traceback" not in errors
    kept = rows(out)
    assert 5 < len(kept) < 40
    finished = _times(out)
    (tmp_path / "go").touch()
    assert main(command[3:]) == 0
    assert len(rows(out)) == 60
    assert {key: when for key, when in _times(out).items() if key in finished} == finished


def _count(folder: Path) -> int:
    try:
        base = sqlite3.connect(f"file:{folder / 'rows.sqlite'}?mode=ro", uri=True)
        count = base.execute("SELECT count(*) FROM rows").fetchone()[0]
        base.close()
    except sqlite3.Error:
        return 0
    return int(count)


def _times(folder: Path) -> dict[str, float]:
    base = sqlite3.connect(folder / "rows.sqlite")
    found = dict(base.execute("SELECT key, processor FROM rows"))
    base.close()
    return found


def test_rows_that_fail_are_reported_and_can_be_tried_again(tmp_path, capsys):
    study, out = tmp_path / "odd.yaml", tmp_path / "out"
    study.write_text("title: Odd\nmeasure: benchmarks.campaign.tasks:failing\nrows: [{seed: [1, 2, 3]}]\n")
    given = ["campaign", str(study), "--out", str(out), "--workers", "1"]
    assert main(given) == 1
    assert "2 failed: ValueError: seed 1 is odd (1); ValueError: seed 3 is odd (1)" in capsys.readouterr().out
    before = _times(out)
    assert main([*given, "--retry"]) == 1
    changed = {key for key, value in _times(out).items() if before[key] != value}
    assert len(changed) == 2


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--set", "sede=3"], "unknown value 'sede' (did you mean 'seed'?)"),
        (["--set", "seed"], "--set seed: is not NAME=VALUE"),
        (["--set", "seed=[1"], "--set seed: not valid YAML"),
        (["--workers", "0"], "0 workers: must be at least 1"),
        (["--minutes", "-1"], "--minutes -1: must be 0 or more"),
        (["--engine", "tcp://10.0.0.5:8786"], "not encrypted"),
        (["--engine", "nonsense"], "neither tls://HOST:PORT"),
    ],
)
def test_what_cannot_be_is_one_line(study, tmp_path, capsys, more, said):
    assert main(["campaign", str(study), "--out", str(tmp_path / "out"), *more]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_another_studys_folder_to_compare_with_is_refused(study, tmp_path, capsys):
    assert main(["campaign", str(study), "--out", str(tmp_path / "out"), "--minutes", "0"]) == 0
    other = tmp_path / "other"
    other.mkdir()
    (other / "letter").touch()
    given = ["campaign", str(study), "--out", str(tmp_path / "out"), "--minutes", "0", "--compare", str(other)]
    capsys.readouterr()
    assert main(given) == 2
    assert "not a folder of a campaign" in capsys.readouterr().err
