"""When the recordings decide between two effects, and when both are to be named."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shake_ros.core.discovery.decision import Refit, decide, distinguishable
from shake_ros.core.discovery.problem import ScoredFit
from shake_ros.core.identification.fit import Fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.declared import effect_candidates
from shake_ros.settings import load_search, load_table

SETTINGS = load_search().replace(margin=0.03, rival=1.3)
NOTHING = SimpleNamespace()


def scored(estimation: float, validation: float) -> ScoredFit:
    return ScoredFit(NOTHING, estimation, validation)  # type: ignore[arg-type]


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
    assert distinguishable(scored(1.0, 1.0), scored(*other), SETTINGS, 1.0) is decided


def test_a_difference_below_what_the_best_leaves_unexplained_does_not_decide() -> None:
    best, other = scored(1.0, 1.0), scored(1.1, 1.1)
    assert [distinguishable(best, other, SETTINGS, noise) for noise in (0.5, 0.95)] == [False, True]


def with_blocks(validation: np.ndarray) -> ScoredFit:
    return ScoredFit(NOTHING, 1.0, float(np.mean(validation)), validation)  # type: ignore[arg-type]


def test_a_difference_that_some_blocks_make_and_others_take_back_is_chance() -> None:
    best = with_blocks(np.ones(40))
    scattered = with_blocks(1.0 + 0.14 + np.where(np.arange(40) % 2, 0.7, -0.7))
    steady = with_blocks(1.0 + 0.14 + np.where(np.arange(40) % 2, 0.05, -0.05))
    worse = replace(scattered, estimation_cost=1.01), replace(steady, estimation_cost=1.01)
    assert [distinguishable(best, other, SETTINGS, 1.0) for other in worse] == [False, True]


def back_pressure(pressure: float, blocks: int = 0) -> Refit:
    """A fitted back pressure of the tank [Pa]; with blocks of the validation data where it is fitted to the whole."""
    tank = next(c for c in effect_candidates() if c.effect == "tank_back_pressure")
    free = FreeParameters(load_table("bergamo"), tank.free)
    fit = Fit(free, free.x_of({tank.strength.name: pressure}), np.zeros(1), np.zeros((1, 1)), 0.0, 1)
    return Refit(tank, ScoredFit(fit, 1.0, 1.0, np.ones(blocks)), 0.0)


@pytest.mark.parametrize(("pressure", "usual"), [(4e5, True), (31e5, False)])
def test_a_back_pressure_as_of_a_blocked_filter_is_not_usual(pressure: float, usual: bool) -> None:
    assert back_pressure(pressure).usual is usual


def test_usual_values_are_named_instead_of_the_best() -> None:
    best, usual = back_pressure(31e5, 40), back_pressure(4e5, 40)
    step = decide((best, usual), SETTINGS, 1.0)
    assert step.chosen is usual
    assert step.alternatives == ("tank_back_pressure",)
