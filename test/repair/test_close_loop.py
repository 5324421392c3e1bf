"""The models that closing the loop passes through."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from closed_loops import CASES, DEAD_BAND, LEAN, command, recording

from shake_ros.declared import effect_candidates, model_structure
from shake_ros.failures import RAISING
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit, never
from shake_ros.fit.nuisances.sensor_filter import SensorFilter
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.records import Record
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.physics.plant.simulation import run
from shake_ros.repair import close_loop as closing
from shake_ros.repair.close_loop import FittedAnswer, passed_through, searched, without_needless_lags
from shake_ros.search.decision import ForwardStep, Refit
from shake_ros.search.problem import ModelStructure, ScoredFit, SearchProblem
from shake_ros.search.selection import GivenAnswer, Selection
from shake_ros.settings import load_table


def test_closing_the_loop_ends_with_the_extended_model() -> None:
    result = command("spool_deadband").result
    assert result.final is result.models[-1]
    assert len(result.models) == len(result.search.steps) == 1
    assert result.final.validation["hold"]["acceleration"] < 0.1 * result.baseline.validation["hold"]["acceleration"]
    assert result.final.table.value("effects.spool_deadband.width") == (
        np.float64(next(p.value for p in result.final.parameters if p.name == "effects.spool_deadband.width"))
    )


def test_closing_the_loop_where_nothing_is_missing_ends_with_the_declared_model() -> None:
    result = command("nothing").result
    assert CASES["nothing"] == {}
    assert result.models == ()
    assert result.final is result.baseline
    assert not result.remaining.above_noise


@pytest.mark.parametrize("hidden", ["spool_deadband", "nothing"])
def test_slow_motion_is_searched_where_the_predictor_leaves_much(hidden: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (effect,) = (c for c in effect_candidates() if c.effect == "spool_deadband")
    asked = []

    def answer(model: ModelStructure, *_: object, slow: bool) -> GivenAnswer:
        asked.append(slow)
        table = model.table.with_values({effect.strength.name: DEAD_BAND})
        return GivenAnswer(table, (effect,), {}) if slow else GivenAnswer(model.table, (), {}, likelihood=Predictor)

    monkeypatch.setattr(closing, "answer", answer)
    model = replace(model_structure(load_table("bergamo")), candidates=(effect,))
    runs = [recording(hidden, seed, name) for seed, name in ((1, "learn"), (2, "hold"))]
    problem = SearchProblem.of(model, runs[:1], runs[1:], LEAN, lambda *_: None)
    _, found = searched(problem, model, runs[:1], runs[1:], lambda *_: None, never, RAISING)
    assert asked == ([False, True] if hidden != "nothing" else [False])
    assert [s.chosen.candidate.effect for s in found.steps] == ([hidden] if hidden != "nothing" else [])


class Recorded:
    """Data whose residuals are a number for every sample; an error of one for the channel."""

    def __init__(self, samples: int) -> None:
        self.samples = samples

    def centred(self, vector: np.ndarray) -> np.ndarray:
        return vector

    def residuals(self, vectors: np.ndarray) -> np.ndarray:
        return np.ones((len(vectors), self.samples))

    def blocks(self) -> np.ndarray:
        return np.arange(self.samples) // 10

    def errors(self, _vector: np.ndarray) -> dict[str, dict[str, float]]:
        return {"run": {"velocity": 1.0}}


@pytest.mark.parametrize("gone", [(), ("constant_force",)], ids=["none", "the first"])
def test_model_that_an_effect_has_left_since_counts_on_the_data_of_the_final_one(gone: tuple[str, ...]) -> None:
    searched, whole = Recorded(40), Recorded(90)
    known = {c.effect: c for c in effect_candidates()}
    first, second = known["constant_force"], known["quadratic_drag"]

    def fitted(data: Recorded, *effects: Any) -> ScoredFit:
        free = FreeParameters(load_table("bergamo"), [p for e in effects for p in e.free])
        x, samples = np.full(len(free.names), 0.1), np.arange(data.samples)
        slope = np.column_stack([np.sin((k + 1) * samples) for k in range(len(x))])
        return ScoredFit(Fit(free, x, np.ones(data.samples), slope, 1.0, 1), 1.0, 1.0)

    declared, along = fitted(searched, known["dead_volume"]), fitted(searched, first)
    final = fitted(whole, second) if gone else fitted(whole, first, second)
    steps = tuple(
        ForwardStep(Refit(c, result, 0.0), ())
        for c, result in ((first, along), (known["film_friction"], along), (second, final))
    )
    problem: Any = SimpleNamespace(estimation=whole, validation=whole)
    models = passed_through(problem, Selection(declared, steps, final, gone), searched.blocks())
    assert [len(m.fit.residuals) for m in models] == [40, *([90, 90] if gone else [40, 40]), 90]
    assert all(p.std_error is not None for p in models[-1].parameters)


@pytest.mark.parametrize(("hidden", "stays"), [(0.0, False), (0.004, True)])
def test_lag_of_a_sensor_stays_only_where_no_filter_explains_as_much(hidden: float, stays: bool) -> None:
    """Behind a filter whose delay was first found too short; the accelerometer itself has a lag [s], or none."""
    (lag,) = (c for c in effect_candidates() if c.effect == "accelerometer_lag")
    delay, cutoff, table = 0.0045, 50.0, load_table("bergamo")
    rng, true, records = np.random.default_rng(1), table.with_values({lag.strength.name: hidden}), []
    for name in ("learn", "hold"):
        u = 0.03 * np.convolve(rng.standard_normal(6000), np.hanning(12) / 6.0, "same")
        out = run(true, u, 1e-3, cutoff=cutoff)
        position = out[:, 0] + 3e-6 * rng.standard_normal(6000)
        late = Record(name, 1e-3, u, position, out[:, 2] + 0.1 * rng.standard_normal(6000), delay=delay, cutoff=cutoff)
        records.append(SensorFilter(0.95 * delay, 0.95 * delay).applied(late))
    structure = replace(model_structure(table), simulator=UnknownModel(table))
    problem = SearchProblem.of(structure, records[:1], records[1:], LEAN, lambda *_: None)
    free = FreeParameters(table.with_values({lag.strength.name: 0.0}), [*structure.free[:3], *lag.free])
    found = problem.converged_from(free, free.x_of({lag.strength.name: 0.002}))
    best = FittedAnswer(GivenAnswer(found.fit.table, (lag,), {}), problem, found)
    assert without_needless_lags(best, (lag.effect,)).effects == (lag.effect,)
    assert bool(without_needless_lags(best, ()).effects) is stays
