"""What stands between a command and the valve."""

from __future__ import annotations

import pytest

from shake_ros.ros.diagnostics import ERROR, OK
from shake_ros.ros.interlock import Interlock

MS = 1_000_000


@pytest.fixture
def lock() -> Interlock:
    """Stale after 10 ms, ramp of 100 ms, a command of 0.5 at 0."""
    made = Interlock(enabled=True, stale_after=10 * MS, ramp_time=100 * MS)
    made.command(0, 0.5)
    return made


def test_fresh_command_acts(lock) -> None:
    assert lock.act(5 * MS) == 0.5
    assert lock.condition() == (OK, "running")


def test_command_beyond_full_opening_is_clipped(lock) -> None:
    lock.command(1 * MS, -7.0)
    assert lock.act(1 * MS) == -1.0


def test_stale_command_ramps_to_zero_and_stays(lock) -> None:
    lock.act(10 * MS)
    ramp = [lock.act(t * MS) for t in range(11, 100)]
    assert ramp[0] == pytest.approx(0.49)
    assert all(after <= before for before, after in zip(ramp, ramp[1:], strict=False))
    assert ramp[-1] == 0.0
    level, text = lock.condition()
    assert level == ERROR and "no command for 0.099 s" in text
    assert lock.holds == 1


def test_hold_ends_with_a_fresh_command(lock) -> None:
    lock.act(200 * MS)
    lock.command(200 * MS, 0.3)
    assert lock.act(201 * MS) == 0.3


def test_fault_holds_in_spite_of_fresh_commands_until_reset(lock) -> None:
    lock.fault = "two publishers"
    for t in range(200):
        lock.command(t * MS, 0.5)
        held = lock.act(t * MS)
    assert held == 0.0
    assert lock.condition() == (ERROR, "safe hold: two publishers")
    lock.reset()
    assert lock.act(200 * MS) == 0.5


@pytest.mark.parametrize("hold", ["stopped", "not enabled", "no command yet"])
def test_nothing_acts_when_stopped_disabled_or_before_the_first_command(lock, hold) -> None:
    if hold == "stopped":
        lock.stopped = True
    elif hold == "not enabled":
        lock.enabled = False
    else:
        lock = Interlock(enabled=True, stale_after=10 * MS, ramp_time=100 * MS)
    assert lock.act(1 * MS) == 0.0
    assert lock.condition()[0] != OK
