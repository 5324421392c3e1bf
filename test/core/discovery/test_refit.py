"""Which effects are refitted, and that the others get their turn before the search gives up far above the noise."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shake_ros.core.discovery import refit
from shake_ros.core.discovery.problem import ScoredFit
from shake_ros.core.discovery.refit import (
    Begun,
    Refit,
    best_start,
    first_refits,
    passed_over,
    report_best,
    rounds,
    short_refits,
    sought,
)
from shake_ros.core.discovery.screening import ScreenedTrial, Screening
from shake_ros.core.identification.approach import Approach
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.settings import load_search, load_table

TRIALS: Any = tuple(
    SimpleNamespace(candidate=SimpleNamespace(effect=effect), gain=gain)
    for effect, gain in (("soft_zone", 0.2), ("slow_valve", 0.1), ("dead_volume", 0.02), ("supply_droop", 0.001))
)
NOTHING: Any = SimpleNamespace()


def names(left: float, refits: int = 2) -> list[list[str]]:
    """Rounds where the validation cost is `left` times that of the noise."""
    settings = load_search().replace(most_refits=refits, much_left=1.3)
    problem: Any = SimpleNamespace(settings=settings, validation=SimpleNamespace(noise_cost=lambda: 1.0))
    return list(rounds(problem, ScoredFit(NOTHING, 1.0, left), Screening(NOTHING, (), TRIALS)))


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


def test_an_effect_that_the_best_resembles_is_compared_though_it_promised_little() -> None:
    mass, tank, other = (
        SimpleNamespace(effect=effect, resembles=resembles)
        for effect, resembles in (
            ("payload_error", ("tank_back_pressure",)),
            ("tank_back_pressure", ("payload_error",)),
            ("soft_zone", ()),
        )
    )
    trials: Any = tuple(SimpleNamespace(candidate=c, gain=0.1) for c in (mass, tank, other))
    candidates: Any = (mass, tank, other)
    refits: Any = [Refit(c, ScoredFit(NOTHING, cost, cost), 0.0) for c, cost in ((mass, 1.0), (other, 2.0))]
    screening = Screening(NOTHING, candidates, trials)
    assert passed_over(refits, screening) == ["tank_back_pressure"]
    assert passed_over(refits[::-1], screening) == []
    assert passed_over(refits, Screening(NOTHING, candidates, trials[::2])) == []


def trial_points(costs: dict[str, float], monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Most trial points of each effect's free runs where predictor runs leave these costs."""
    settings, given = load_search().replace(hopeless=2.0, first_evaluations=5), dict[str, int]()

    def begun(_problem: Any, _screening: Any, effect: str, _most: int, _least: float) -> Any:
        way = SimpleNamespace(predictor_cost=costs[effect])
        return SimpleNamespace(trial=SimpleNamespace(candidate=SimpleNamespace(effect=effect)), way=way)

    def finished(_problem: Any, _screening: Any, way: Any, most: int, _least: float) -> Any:
        given[way.trial.candidate.effect] = most
        return way.trial

    monkeypatch.setattr(refit, "begun", begun)
    monkeypatch.setattr(refit, "finished", finished)
    problem: Any = SimpleNamespace(settings=settings, progress=lambda text, part: None, leaves_much=lambda way: False)
    problem.unstopped = lambda: problem
    short_refits(problem, NOTHING, list(costs))
    return given


def test_backlash_is_sought_from_slow_to_fast_with_friction_as_declared(monkeypatch: pytest.MonkeyPatch) -> None:
    backlash = next(c for c in effect_candidates() if c.effect == "coupling_backlash")
    free = FreeParameters(load_table("bergamo"), [*free_parameters(), *backlash.free])
    bent = np.clip(2.0 * free.start(), free.low, free.high)
    gap, level = (free.names.index(n) for n in ("effects.coupling_backlash.gap", "friction.coulomb_level"))
    moved = free.names.index("valve.flow_coefficient")
    begun_from: list[np.ndarray] = []

    def from_slow_to_fast(_problem: Any, _free: Any, starts: list[np.ndarray], _own: list[str], most: float) -> Any:
        begun_from.extend(starts)
        assert most == 7.0
        return starts[0]

    monkeypatch.setattr(refit, "from_slow_to_fast", from_slow_to_fast)
    problem: Any = SimpleNamespace(estimation_pieces=None, progress=lambda text, part: None)
    trial: Any = SimpleNamespace(candidate=backlash)
    best = sought(problem, Begun(trial, free, Approach(bent)), 7.0).way.start
    assert sorted({round(float(x[gap]), 9) for x in begun_from}) == [0.2, 0.5, 1.0, 2.0, 4.0]
    assert best[gap] == pytest.approx(0.2)
    assert best[level] == free.start()[level]
    assert best[moved] == bent[moved]


def test_a_refit_ends_where_predictor_runs_show_that_another_effect_is_far_better(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    costs = {"soft_zone": 60.0, "slow_valve": 6.0, "dead_volume": 11.0}
    assert trial_points(costs, monkeypatch) == {"soft_zone": 1, "slow_valve": 5, "dead_volume": 5}


def test_no_refit_ends_early_without_a_predictor(monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(trial_points({"soft_zone": 0.0, "slow_valve": 0.0}, monkeypatch).values()) == {5}


@pytest.mark.parametrize(("cost", "told"), [(40.0, 1), (900.0, 0)])
def test_an_effect_that_leads_clearly_is_told_before_the_end(cost: float, told: int) -> None:
    said = list[str]()
    problem: Any = SimpleNamespace(
        settings=load_search(),
        validation=SimpleNamespace(noise_cost=lambda: 1.0),
        progress=lambda text, part: said.append(text),
    )
    candidate: Any = SimpleNamespace(effect="soft_zone")
    report_best(problem, Refit(candidate, ScoredFit(NOTHING, cost, cost), 0.0), ScoredFit(NOTHING, 1000.0, 1000.0))
    line = "best so far: soft_zone, 6.3 × the noise on validation data (declared model: 31.6)"
    assert said == [line] * told


def test_a_refit_does_not_begin_from_nothing_where_no_other_parameter_has_a_slope() -> None:
    (candidate,) = (c for c in effect_candidates() if c.effect == "specimen_resonance")
    free = FreeParameters(load_table("bergamo"), list(free_parameters()))
    column = list(free.base.fields).index("effects.specimen_resonance.mass")
    problem: Any = SimpleNamespace(residuals=lambda vectors: vectors[:, [column]])  # the lighter the better
    x = free.start()
    current: Any = SimpleNamespace(free=free, x=x)
    trials = [ScreenedTrial(candidate, i, 0.1, part, x) for i, part in ((4, 2.0), (0, 0.0))]
    found, start = best_start(problem, current, trials, (0.25, 1.0))
    assert found.table(start).value("effects.specimen_resonance.mass") == pytest.approx(0.25 * 30.0)


@pytest.mark.parametrize(
    ("promises", "takes", "expected"),
    [
        ((0.8, 0.3, 0.3), 0.7, [["slow_valve"]]),  # far ahead, and it keeps its promise
        ((0.8, 0.3, 0.3), 0.3, [["slow_valve"], ["soft_zone", "dead_volume"]]),
        ((0.8, 0.5, 0.3), 0.7, [["slow_valve", "soft_zone", "dead_volume"]]),  # not far ahead
        ((0.2, 0.05, 0.05), 0.2, [["slow_valve", "soft_zone", "dead_volume"]]),  # does not promise much
    ],
)
def test_effect_far_ahead_of_all_others_is_refitted_alone_where_it_keeps_its_promise(
    promises: tuple[float, ...], takes: float, expected: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    candidates = [SimpleNamespace(effect=e, resembles=()) for e in ("slow_valve", "soft_zone", "dead_volume")]
    trials: Any = tuple(SimpleNamespace(candidate=c, gain=g) for c, g in zip(candidates, promises, strict=True))
    asked = list[list[str]]()

    def short(_problem: Any, _screening: Any, effects: list[str]) -> list[Refit]:
        asked.append(effects)
        return [Refit(NOTHING, ScoredFit(NOTHING, 10.0 * (1.0 - takes), 1.0), 0.0) for _ in effects]

    monkeypatch.setattr(refit, "short_refits", short)
    problem: Any = SimpleNamespace(settings=load_search())
    effects = [c.effect for c in candidates]
    found = first_refits(problem, Screening(NOTHING, (), trials), effects, ScoredFit(NOTHING, 10.0, 1.0))
    assert asked == expected
    assert len(found) == sum(len(each) for each in expected)
