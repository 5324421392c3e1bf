"""Where no effect promises much or all were in vain, a clear function is the answer before other effects are tried."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from shake_ros.core.discovery import forward_selection as forward
from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.decision import ForwardStep
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem
from shake_ros.core.discovery.refit import Refit
from shake_ros.core.discovery.selection import Selection
from shake_ros.core.discovery.unlisted_functions import OF_MOTION, UNLISTED, FunctionSearch
from shake_ros.settings import load_search

BLOCKS = np.ones(4)


def scored(cost: float) -> ScoredFit:
    return ScoredFit(cast("Any", None), cost, cost, BLOCKS)


def refitted(effect: str, cost: float) -> Refit:
    return Refit(CandidateEffect(effect, (), (), "force", ("position",)), scored(cost), 0.5)


@dataclass
class Case:
    """A step of a search whose refits are all in vain; what was refitted, and what came of it."""

    refits: list[str]
    step: ForwardStep | None
    functions: FunctionSearch | None
    said: list[str]


def tried(monkeypatch: pytest.MonkeyPatch, function: float, moved: float, *, promises: bool = False) -> Case:
    """A step from a score of 1000 with a noise of 1; costs of a function with even nodes and with moved ones.

    promises : whether it leads all effects at first sight.
    """
    refits, said = list[str](), list[str]()

    def refit(problem: object, screening: object, effects: list[str], *_: object) -> tuple[Refit, ...]:
        refits.extend(effects)
        return (refitted(effects[0], 900.0),)

    found = refitted(UNLISTED, function)
    search = FunctionSearch({}, found)
    monkeypatch.setattr(forward, "screen", lambda *_: SimpleNamespace(trials=()))
    monkeypatch.setattr(forward, "rounds", lambda *_: iter([["first"], ["other"]]))
    monkeypatch.setattr(forward, "refit", refit)
    monkeypatch.setattr(forward, "converge", lambda problem, current, refits: (list(refits), []))
    monkeypatch.setattr(forward, "improves", lambda *_: False)
    monkeypatch.setattr(forward, "or_function", lambda *_, screened: (ForwardStep(found, (found,)), search))
    leading = [SimpleNamespace(kind=OF_MOTION[1], gain=0.8)] if promises else []
    monkeypatch.setattr(forward, "leading_functions", lambda *_: leading)
    better = refitted(UNLISTED, moved)
    monkeypatch.setattr(forward, "refined_function", lambda problem, step: ForwardStep(better, (better,)))
    problem = SimpleNamespace(
        settings=load_search(),
        progress=lambda text, part: said.append(text),
        at_noise=lambda m: m.validation_cost < 1.05,
        validation=SimpleNamespace(noise_cost=lambda: 1.0),
        unstopped=lambda: problem,
    )
    step, _, _, functions = forward.forward_step(cast("SearchProblem", problem), scored(1000.0), ())
    return Case(refits, step, functions, said)


def test_a_function_that_leaves_the_noise_is_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    case = tried(monkeypatch, 25.0, 1.0)
    assert case.refits == ["first"]
    assert case.step is not None
    assert case.step.chosen.candidate.effect == UNLISTED
    assert case.step.chosen.result.validation_cost == 1.0


@pytest.mark.parametrize(("function", "moved"), [(25.0, 2.0), (200.0, 1.0)])
def test_one_that_leaves_more_waits_for_the_other_effects(
    monkeypatch: pytest.MonkeyPatch, function: float, moved: float
) -> None:
    case = tried(monkeypatch, function, moved)
    assert case.refits == ["first", "other"]
    assert case.step is None
    assert case.functions is not None  # known, need not be fitted again


def test_a_function_that_promises_far_more_than_effects_goes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    case = tried(monkeypatch, 25.0, 1.0, promises=True)
    assert case.refits == []
    assert case.step is not None
    assert case.step.chosen.candidate.effect == UNLISTED
    assert case.said == [
        "best so far: unlisted effect, place friction, depends on position and direction, predicted to remove 80 % of "
        "the residual"
    ]


def test_one_that_does_not_keep_its_promise_is_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    case = tried(monkeypatch, 25.0, 2.0, promises=True)
    assert case.refits == ["first", "other"]
    assert case.step is None
    assert case.functions is not None


@pytest.mark.parametrize("listed", [True, False])
def test_a_function_of_two_quantities_comes_where_nothing_else_helps(
    monkeypatch: pytest.MonkeyPatch, *, listed: bool
) -> None:
    search, without = FunctionSearch({}, None), scored(1000.0)
    effect, both, better = (refitted(name, 400.0) for name in ("spool_deadband", UNLISTED, UNLISTED))
    step = ForwardStep(effect, (effect,)) if listed else None
    monkeypatch.setattr(forward, "with_nuisances", lambda problem, found: (problem, found))
    monkeypatch.setattr(forward, "forward_step", lambda *_: (step, (), without, None))
    monkeypatch.setattr(forward, "joint_steps", lambda *_: ())
    monkeypatch.setattr(forward, "or_function", lambda *_: (step, search))
    monkeypatch.setattr(forward, "function_of_two", lambda *_: ForwardStep(both, (both,)))
    monkeypatch.setattr(forward, "with_second_quantity", lambda problem, step: ForwardStep(better, (better,)))
    problem = SimpleNamespace(settings=replace(load_search(), most_effects=1), at_noise=lambda m: False)
    model = SimpleNamespace(candidates=(effect.candidate,), shown=())
    *_, last = forward.stages(cast("Any", problem), Selection(without, (), without), cast("Any", model))
    assert [s.chosen for s in last.steps] == [effect if listed else better]
