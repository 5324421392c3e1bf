"""A long piece of work shows how far it is, and ends early where it is asked to."""

from __future__ import annotations

import signal
import time

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.api.progress import SO_FAR, Ending, Progress
from shake_ros.quantities import ShakeError
from shake_ros.search.problem import Stopped, unstopped


def test_a_search_ends_when_its_minutes_are_over() -> None:
    with Progress("search", False) as bar, Ending(bar, 1e-9) as ending, pytest.raises(Stopped):
        ending("step", 0.5)


def test_without_a_limit_it_goes_on_and_what_is_unstopped_always_does() -> None:
    with Progress("search", False) as bar, Ending(bar) as endless, Ending(bar, 1e-9) as over:
        endless("step", 0.5)
        unstopped(over)("step", 0.5)


def test_a_fifth_of_the_minutes_is_kept_for_what_follows_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    with Progress("search", False) as bar:
        limited, endless = Ending(bar, 5.0), Ending(bar)
        clock[0] += 239.0
        assert not limited.over()
        clock[0] += 2.0
        assert (limited.over(), limited.deadline_passed()) == (True, False)
        clock[0] += 60.0
        assert limited.deadline_passed() and not endless.over() and not endless.deadline_passed()


def test_ctrl_c_ends_it_with_what_is_found_and_interrupts_when_pressed_again() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Progress("search", False) as bar, Ending(bar) as ending:
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(Stopped):
            ending("step", 0.5)
        assert not ending.deadline_passed()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_minutes_are_above_nought() -> None:
    with Progress("search", False) as bar, pytest.raises(ShakeError, match="minutes = 0"):
        Ending(bar, 0.0)


def test_an_answer_so_far_is_a_line_each_time(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress("work") as bar:
        bar("one thing", 0.1)
        bar(f"{SO_FAR}a", 0.2)
        bar("one thing", 0.3)
        bar(f"{SO_FAR}a", 0.4)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["work: one thing", "work: best so far: a", "work: best so far: a"]


def test_a_function_is_called_with_it_as_with_anything_else() -> None:
    told = list[str]()
    with Progress("work", lambda text, part: told.append(text)) as bar:
        bar(f"{SO_FAR}a", 0.2)
    assert told == ["best so far: a"]


def test_a_function_is_called_with_a_fit_by_free_runs() -> None:
    time, told = np.arange(1500) / 1000, list[str]()
    rng = np.random.default_rng(0)
    force, position = 100 * np.sin(9 * time), -np.sin(9 * time) / 8.1 + 1e-6 * rng.standard_normal(len(time))
    runs = sr.recording("push", time, 0 * time, position, force=force)
    sr.identify(sr.model("axis"), runs, progress=lambda text, part: told.append(text))
    assert "fitting the declared model" in told
    assert told[-1] == "residuals and what would help"
