"""Several effects in one step: only far above the noise, from the middle trials of those that need a place to begin."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shake_ros.core.discovery import shown_effects as module
from shake_ros.core.discovery.problem import ScoredFit, SearchProblem
from shake_ros.core.discovery.shown_effects import ALSO, HIGH_RATIO, joint_steps
from shake_ros.core.identification.fit import Fit
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.declared import model_structure
from shake_ros.settings import load_search, load_table

MODEL = model_structure(load_table("bergamo"))
FREE = FreeParameters(MODEL.table, MODEL.free)


def problem_and_fit(times_the_noise: float) -> tuple[SearchProblem, ScoredFit]:
    data: Any = SimpleNamespace(noise_cost=lambda: 0.5)
    problem = SearchProblem(data, data, data, data, (), load_search(), lambda text, part: None)
    p = len(FREE.names)
    fit = Fit(FREE, FREE.start(), np.zeros(1), np.zeros((1, p)), 0.0, 1)
    return problem, ScoredFit(fit, 0.5 * times_the_noise**2, 1.0, np.ones(1))


def test_near_the_noise_nothing_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "joint_start", lambda *given: pytest.fail("tried"))
    problem, current = problem_and_fit(0.99 * HIGH_RATIO)
    assert joint_steps(problem, MODEL, current) == ()


def test_far_from_it_those_that_hold_are_fitted_together(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, Any] = {}

    def start(_problem: Any, _free: Any, part: Any, guess: Any) -> tuple[Any, tuple[str, ...]]:
        seen.update(part)
        return guess, ("soft_zone", "specimen_resonance")

    monkeypatch.setattr(module, "joint_start", start)
    monkeypatch.setattr(module, "shown_steps", lambda _problem, model, _current: model.shown)
    problem, current = problem_and_fit(1.01 * HIGH_RATIO)
    assert joint_steps(problem, MODEL, current) == ("soft_zone", "specimen_resonance")
    assert set(ALSO) < set(seen) and all(effect.together for effect in seen.values())
    frequency = seen["specimen_resonance"].together["effects.specimen_resonance.frequency"]
    assert 3.0 < frequency < 20.0
