"""Ending a search early."""

from __future__ import annotations

import signal
import time

import pytest

from shake_ros.api.progress import Ending, Progress
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
