"""Convergence before a decision: of an effect that can stand for the best one, and of the model without either."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shake_ros.core.discovery.convergence import reconverged, settled, taken_over
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem
from shake_ros.core.discovery.refit import Refit
from shake_ros.core.discovery.selection import Selection
from shake_ros.core.identification.fit import fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.settings import load_search, load_table

TABLE = load_table("bergamo")
POOL = {c.effect: c for c in effect_candidates()}
MASS, TANK = POOL["payload_error"], POOL["tank_back_pressure"]
VISCOUS = next(p for p in free_parameters() if p.name == "friction.viscous")
NAMES = (VISCOUS.name, MASS.strength.name, TANK.strength.name)
COLUMNS = [list(TABLE.fields).index(name) for name in NAMES]
NOISE, FORCE, INERTIA = np.random.default_rng(3).standard_normal((3, 500))


class OneForTheOther:
    """More mass and more friction, or a back pressure: only the ratio of force to inertia shows."""

    def predictor(self, _injection: float) -> OneForTheOther:
        return self

    def noise_cost(self) -> float:
        return 0.01

    def centred(self, vector: np.ndarray) -> np.ndarray:
        return vector

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        viscous, mass, tank = vectors[:, COLUMNS].T
        heavier, weaker = 1.0 + mass / 650.0, 1.0 - tank / 2e7
        rest = np.outer(viscous / weaker / heavier - 500.0, FORCE / 10.0)
        return 0.1 * NOISE + rest + np.outer(heavier / weaker - 1.2, 100.0 * INERTIA)

    def blocks(self) -> np.ndarray:
        return np.zeros(len(NOISE), dtype=int)


def problem_of(both: Any, **changes: Any) -> SearchProblem:
    """The same residuals as estimation and validation data."""
    return SearchProblem(both, both, both, both, (), load_search().replace(**changes), lambda text, part: None)


def fitted(candidate: Any, evaluations: int) -> Refit:
    free = FreeParameters(TABLE, [VISCOUS, candidate.strength])
    x = free.x_of({VISCOUS.name: 800.0})
    result = fit(OneForTheOther(), free, x, evaluations=evaluations, tolerance=1e-10)
    return Refit(candidate, problem_of(OneForTheOther()).scored(result), 0.5)


def test_the_second_reaches_what_the_first_reaches() -> None:
    best, early = fitted(MASS, 60), fitted(TANK, 1)
    assert early.result.estimation_cost > 100.0 * best.result.estimation_cost
    done = taken_over(problem_of(OneForTheOther(), continued_evaluations=30), best, early)
    assert done.candidate is TANK
    assert done.result.fit.free.names == (VISCOUS.name, TANK.strength.name)
    assert done.result.fit.table.value(MASS.strength.name) == MASS.neutral
    assert done.result.estimation_cost == pytest.approx(best.result.estimation_cost, rel=1e-6)


def test_a_fit_that_is_as_good_stays_as_it_is() -> None:
    best, done = fitted(MASS, 60), fitted(TANK, 200)
    assert done.result.estimation_cost == pytest.approx(best.result.estimation_cost, rel=1e-6)
    again = taken_over(problem_of(OneForTheOther(), continued_evaluations=3), best, done)
    assert again.result.estimation_cost <= done.result.estimation_cost


ONE: Any = SimpleNamespace(names=("x",), low=np.array([-3.0]), high=np.array([3.0]), vectors=np.atleast_2d)


class TwoValleys:
    """Residuals x² − 1 and 0.3 (x − 1): nought at 1, a worse valley of its own near −0.95."""

    def predictor(self, _injection: float) -> TwoValleys:
        return self

    def noise_cost(self) -> float:
        return 0.0

    def centred(self, vector: np.ndarray) -> np.ndarray:
        return vector

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        return np.hstack([vectors**2 - 1.0, 0.3 * (vectors - 1.0)])

    def blocks(self) -> np.ndarray:
        return np.zeros(2, dtype=int)


VALLEYS = problem_of(TwoValleys())


def stuck_at(x: float) -> ScoredFit:
    return VALLEYS.scored(fit(TwoValleys(), ONE, np.array([x]), evaluations=50, tolerance=1e-10))


def led_to(x: float) -> Refit:
    richer: Any = SimpleNamespace(x=np.array([x, 7.0]))  # the effect's own parameter comes last
    nothing: Any = SimpleNamespace()
    return Refit(nothing, ScoredFit(richer, 0.1, 0.1), 0.0)


def test_a_fit_that_sits_in_the_worse_valley_is_led_out_of_it() -> None:
    current = stuck_at(-1.2)
    assert current.fit.x[0] == pytest.approx(-0.953, abs=0.001)
    again = reconverged(VALLEYS, current, led_to(0.6))
    assert again.fit.x[0] == pytest.approx(1.0, abs=1e-5)
    assert again.fit.cost < 1e-9 < current.fit.cost


def test_a_fit_that_has_converged_stays_the_one_it_is() -> None:
    current = stuck_at(0.7)
    assert reconverged(VALLEYS, current, led_to(0.9)) is current
    assert reconverged(VALLEYS, current, led_to(-1.2)) is current


def test_a_better_declared_fit_takes_the_place_of_the_declared_one() -> None:
    worse, better = stuck_at(-1.2), stuck_at(0.7)
    found = Selection(worse, (), worse).with_better_fit(better)
    assert (found.declared, found.final, found.steps) == (better, better, ())


def test_a_refit_that_comes_near_the_noise_is_brought_to_its_end() -> None:
    start, rough = fitted(MASS, 1), {"converged_far": 0.1, "converged": 1e-10}
    near, far = (
        settled(problem_of(OneForTheOther(), much_left=left, **rough), start).result.fit for left in (10.0, 1e-6)
    )
    end = fitted(MASS, 40).result.fit
    assert near.cost == pytest.approx(end.cost, rel=1e-9)
    assert far.cost > 1.01 * end.cost
