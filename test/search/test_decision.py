"""When the recordings decide between two effects, and when both are to be named."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from linear_effects import FIRST, SECOND, TABLE, Hidden, fitted, problem_of, step

from shake_ros.declared import effect_candidates
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit
from shake_ros.search.decision import PRIOR, Refit, decide, in_its_place, log_odds, unexplained, without
from shake_ros.search.problem import ScoredFit
from shake_ros.settings import load_search, load_table

SAMPLES, BLOCKS = 4000, 40  # of the validation data, and of the data of the fit as many


def problem(noise: float = 1.0) -> Any:
    """A problem with nothing but its size. noise : mean square of the weighted residuals that it leaves."""
    data = SimpleNamespace(noise_cost=lambda: noise)
    return SimpleNamespace(settings=load_search(), estimation=data, validation=data)


def scored(estimation: float, validation: float | np.ndarray, samples_for_one: float = 1.0) -> ScoredFit:
    """A fit of given costs; the latter in all, or by block. samples_for_one : that its residuals have."""
    fit: Any = SimpleNamespace(residuals=np.zeros(SAMPLES), x=np.zeros(10))
    each = np.broadcast_to(validation, BLOCKS)
    return ScoredFit(fit, estimation, float(np.mean(each)), SAMPLES / BLOCKS * each, samples_for_one)


@pytest.mark.parametrize(
    ("estimation", "validation", "gained"),
    [
        (1.1, 1.1, 200.0),  # of 4000 residuals of unit variance half the difference of the sums of squares
        (1.1, 1.05, 100.0),  # no more than both kinds of recordings gain
        (1.01, 1.2, 20.0),
        (0.99, 1.2, -20.0),
    ],
)
def test_odds_are_the_gain_in_log_likelihood_of_the_data_that_gain_less(
    estimation: float, validation: float, gained: float
) -> None:
    assert log_odds(scored(1.0, 1.0), scored(estimation, validation)) == pytest.approx(gained)


def test_fit_to_pieces_counts_as_if_to_as_much_data_as_judge_it() -> None:
    best = scored(1.0, 1.0)
    best.fit.residuals = np.zeros(SAMPLES // 4)  # type: ignore[misc]
    assert log_odds(best, scored(1.01, 1.2)) == pytest.approx(20.0)


def test_residuals_that_last_count_by_their_independent_samples() -> None:
    lasting = scored(1.0, 1.0, samples_for_one=20.0)
    assert log_odds(lasting, scored(1.1, 1.1)) == pytest.approx(10.0)


def test_an_effect_and_its_parameter_have_a_price() -> None:
    more, less = scored(1.0, 1.0), scored(1.1, 1.1)
    less.fit.x = np.zeros(9)  # type: ignore[misc]
    price = PRIOR + 0.5 * math.log(10 * BLOCKS)
    assert log_odds(more, less, effects=1) == pytest.approx(200.0 - price)


def test_a_difference_counts_only_beyond_what_remains_unexplained() -> None:
    best, other = scored(2.0, 2.0), scored(2.5, 2.5)
    left = unexplained(problem(), best)
    assert left == pytest.approx(2.0 - 1.15**2)
    assert log_odds(best, other) > 100.0
    assert log_odds(best, other, left=left) < 0.0


def test_calm_blocks_do_not_speak_against_a_difference_by_what_loud_ones_leave() -> None:
    loud = np.where(np.arange(BLOCKS) % 2, 1.9, 0.1)
    best, other = scored(2.0, 2.0 * loud), scored(4.0, 4.0 * loud)
    assert log_odds(best, other, left=1.0) == pytest.approx(0.5 * log_odds(best, other))


def test_a_difference_that_some_blocks_make_and_others_take_back_is_chance() -> None:
    swing = np.where(np.arange(BLOCKS) % 2, 1.0, -1.0)
    scattered, steady = scored(1.2, 1.14 + 0.9 * swing), scored(1.2, 1.14 + 0.05 * swing)
    best = scored(1.0, 1.0)
    assert log_odds(best, scattered) < 3.0 < 100.0 < log_odds(best, steady)


def test_a_gain_in_the_loud_part_of_an_earthquake_alone_counts_in_full() -> None:
    loud = scored(1.2, 1.0 + 5.0 * (np.arange(BLOCKS) < 2))
    assert log_odds(scored(1.0, 1.0), loud) == pytest.approx(0.5 * SAMPLES * 0.2)


def back_pressure(pressure: float) -> Refit:
    """A fitted back pressure of the tank [Pa]."""
    tank = next(c for c in effect_candidates() if c.effect == "tank_back_pressure")
    free = FreeParameters(load_table("bergamo"), tank.free)
    fit = Fit(free, free.x_of({tank.strength.name: pressure}), np.zeros(SAMPLES), np.zeros((1, 1)), 0.0, 1)
    return Refit(tank, ScoredFit(fit, 1.0, 1.0, np.full(BLOCKS, SAMPLES / BLOCKS)), 0.0)


@pytest.mark.parametrize(("pressure", "usual"), [(4e5, True), (31e5, False)])
def test_a_back_pressure_as_of_a_blocked_filter_is_not_usual(pressure: float, usual: bool) -> None:
    assert back_pressure(pressure).usual is usual


def test_usual_values_are_named_instead_of_the_best() -> None:
    best, usual = back_pressure(31e5), back_pressure(4e5)
    step = decide(problem(), (best, usual))
    assert step.chosen is usual
    assert step.alternatives == ("tank_back_pressure",)


def test_an_effect_that_took_the_place_of_another_can_be_taken_out_in_turn() -> None:
    problem = problem_of(Hidden(0.0, 2.0))
    there = TABLE.with_values({SECOND.strength.name: SECOND.strength.scale})
    exchanged = in_its_place(problem, fitted(problem, FIRST), step(problem, FIRST), SECOND, there)
    assert exchanged.fit.x[-1] == pytest.approx(2.0, rel=0.01)
    bare = without(problem, exchanged, SECOND)
    assert bare.estimation_cost == pytest.approx(fitted(problem).estimation_cost)
    assert bare.fit.table.value(SECOND.strength.name) == 0.0
