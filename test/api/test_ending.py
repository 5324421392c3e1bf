"""A search that is told to end."""

from __future__ import annotations

import signal
import time

import pytest

from shake_ros.api.progress import Ending, Progress
from shake_ros.core.discovery.problem import Stopped, unstopped
from shake_ros.core.quantities import ShakeError


def test_a_search_ends_when_its_minutes_are_over() -> None:
    with Progress("search", False) as bar, Ending(bar, 1e-9) as ending, pytest.raises(Stopped):
        ending("step", 0.5)


def test_without_a_limit_it_goes_on_and_what_is_unstopped_always_does() -> None:
    with Progress("search", False) as bar, Ending(bar) as endless, Ending(bar, 1e-9) as over:
        endless("step", 0.5)
        unstopped(over)("step", 0.5)


def test_what_follows_the_search_has_a_quarter_of_its_time_more(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    with Progress("search", False) as bar:
        late, brief, endless = Ending(bar, 4.0), Ending(bar, 0.5), Ending(bar)
        clock[0] += 61.0
        assert (late.over(), brief.over(), brief.deadline_passed()) == (False, True, True)  # 30 s and 20 more
        clock[0] += 230.0
        assert (late.over(), late.deadline_passed()) == (True, False)
        clock[0] += 10.0
        assert late.deadline_passed() and not endless.over() and not endless.deadline_passed()


def test_ctrl_c_ends_it_with_what_is_found_and_interrupts_when_pressed_again() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Progress("search", False) as bar, Ending(bar) as ending:
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(Stopped):
            ending("step", 0.5)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_minutes_are_above_nought() -> None:
    with Progress("search", False) as bar, pytest.raises(ShakeError, match="minutes = 0"):
        Ending(bar, 0.0)
