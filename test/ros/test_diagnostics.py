"""What a node counts."""

from __future__ import annotations

import pytest

from shake_ros.ros.diagnostics import Input

PERIOD = 1_000_000


@pytest.fixture
def counted() -> Input:
    return Input("joint_states", PERIOD)


def test_gap_in_the_stamps_counts_as_lost(counted) -> None:
    for k in (1, 2, 3, 7, 8):
        assert counted.count(k * PERIOD)
    assert (counted.received, counted.lost, counted.doubled) == (5, 3, 0)


def test_stamp_off_the_grid_by_less_than_half_a_period_is_no_loss(counted) -> None:
    for stamp in (0, PERIOD + PERIOD // 3, 2 * PERIOD - PERIOD // 4):
        counted.count(stamp)
    assert counted.lost == 0


@pytest.mark.parametrize("stamp", [5, 4])
def test_same_or_earlier_stamp_is_doubled_and_not_counted(counted, stamp) -> None:
    counted.count(5 * PERIOD)
    assert not counted.count(stamp * PERIOD)
    assert (counted.received, counted.doubled) == (1, 1)


def test_input_that_never_came_is_infinitely_old(counted) -> None:
    assert counted.age() == float("inf")
    counted.count(PERIOD)
    assert counted.age() < 1.0
