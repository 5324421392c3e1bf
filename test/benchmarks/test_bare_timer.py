"""What must keep real time may fail only beside a timer that kept it, and is otherwise tried again."""

from __future__ import annotations

import json
import subprocess
import sys

import machine_time
import pytest
from machine_time import ATTEMPTS, PROGRAM, BareTimer, on_a_machine_that_keeps_time


class StandIn:
    """A timer that says what it is told to."""

    said: list[str]

    def __enter__(self) -> StandIn:
        return self

    def __exit__(self, *_: object) -> None:
        self.lateness = StandIn.said.pop(0)


@pytest.mark.parametrize(
    ("said", "fails", "attempts", "end"),
    [
        (["late"], 0, 1, None),
        (["late", ""], 1, 2, None),
        (["late", ""], 2, 2, AssertionError),
        ([""], 1, 1, AssertionError),
        (["late"] * ATTEMPTS, ATTEMPTS, ATTEMPTS, pytest.skip.Exception),
    ],
    ids=["passes", "void, then passes", "void, then fails", "fails", "void to the end"],
)
def test_failure_counts_where_the_machine_kept_time(monkeypatch, said, fails, attempts, end) -> None:
    made = []

    @on_a_machine_that_keeps_time
    def judged() -> None:
        made.append(1)
        assert len(made) > fails

    StandIn.said = list(said)
    monkeypatch.setattr(machine_time, "BareTimer", StandIn)
    if end is None:
        judged()
    else:
        with pytest.raises(end):
            judged()
    assert len(made) == attempts


def test_bare_timer_counts_what_it_missed() -> None:
    with subprocess.Popen([sys.executable, "-I", "-S", str(PROGRAM)], stdin=-1, stdout=-1, text=True) as timer:
        with pytest.raises(subprocess.TimeoutExpired):
            timer.wait(0.5)
        found = json.loads(timer.communicate(timeout=30.0)[0])
    assert found["ticks"] >= 64 and found["missed"] >= 0
    assert 0.0 <= found["p50"] <= found["p99"] <= found["p999"] <= found["max"]
    with BareTimer() as beside:
        pass
    assert isinstance(beside.lateness, str)
