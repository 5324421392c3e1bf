"""Which effects are refitted, and that the others get their turn before the search gives up far above the noise."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shake_ros.core.discovery.judging import Policy
from shake_ros.core.discovery.step import waves

SCREENED: Any = [
    SimpleNamespace(candidate=SimpleNamespace(effect=effect), gain=gain)
    for effect, gain in (("soft_zone", 0.2), ("slow_valve", 0.1), ("dead_volume", 0.02), ("supply_droop", 0.001))
]


def names(left: float, refits: int = 2) -> list[list[str]]:
    """Waves where the held-out cost is `left` times that of the noise."""
    hold = SimpleNamespace(residuals=lambda rows: np.full((1, 4), np.sqrt(left)), noise_cost=lambda: 1.0)
    ground: Any = SimpleNamespace(policy=Policy(refits=refits, much_left=1.3), hold=hold)
    current: Any = SimpleNamespace(x=np.zeros(1), free=SimpleNamespace(vectors=np.atleast_2d))
    return list(waves(ground, current, SCREENED))


def test_the_promising_come_first_and_all_others_where_much_is_left() -> None:
    assert names(2.0) == [["soft_zone", "slow_valve"], ["dead_volume", "supply_droop"]]


def test_near_the_noise_the_promising_are_all() -> None:
    assert names(1.2) == [["soft_zone", "slow_valve"]]


def test_what_promises_next_to_nothing_is_not_among_the_first() -> None:
    assert names(1.2, refits=9) == [["soft_zone", "slow_valve", "dead_volume"]]


@pytest.mark.parametrize("left", [1.0, 5.0])
def test_no_effect_is_refitted_twice(left: float) -> None:
    flat = [name for wave in names(left, refits=3) for name in wave]
    assert len(flat) == len(set(flat))
