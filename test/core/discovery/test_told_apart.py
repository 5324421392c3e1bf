"""When the recordings decide between two effects, and when both are to be named."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from shake_ros.core.discovery.search import Attempt, Policy, told_apart, unscreened_likes

POLICY = Policy(margin=0.03, rival=1.3)
NOTHING = SimpleNamespace()


def attempt(learn: float, hold: float) -> Attempt:
    return Attempt(NOTHING, NOTHING, learn, hold, 0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("other", "decided"),
    [
        ((1.01, 1.02), False),  # all but equal
        ((1.10, 1.10), True),  # both kinds of recordings prefer the first
        ((0.98, 1.20), False),  # they contradict each other
        ((1.20, 0.98), False),
        ((0.98, 2.00), True),  # far off in what counts
    ],
)
def test_two_effects_are_told_apart_only_where_all_recordings_agree(other: tuple[float, float], decided: bool) -> None:
    assert told_apart(attempt(1.0, 1.0), attempt(*other), POLICY) is decided


def test_an_effect_that_the_best_resembles_is_compared_though_screening_passed_it_over() -> None:
    mass = SimpleNamespace(effect="payload_error", resembles=("tank_back_pressure",))
    tank = SimpleNamespace(effect="tank_back_pressure", resembles=("payload_error",))
    other = SimpleNamespace(effect="soft_zone", resembles=())
    pool = (mass, tank, other)
    tried = [Attempt(c, NOTHING, cost, cost, 0.0) for c, cost in ((mass, 1.0), (other, 2.0))]  # type: ignore[arg-type]
    assert unscreened_likes(tried, pool) == [tank]  # type: ignore[arg-type]
    assert unscreened_likes(tried[::-1], pool) == []  # type: ignore[arg-type]
