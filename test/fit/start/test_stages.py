"""The first stages of a fit without a data sheet: friction begins anew once an effect that bent it is there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from foreign_run import foreign_run
from scipy.signal import lfilter

from shake_ros.declared import effect_candidates, model_structure, unknown_model
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.nuisances.estimates import NuisanceEstimates, null_shifts
from shake_ros.fit.nuisances.prepared import Nuisance, Prepared, prepared
from shake_ros.fit.nuisances.sensor_pair import BaseMode, SensorPair
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.start import stages
from shake_ros.fit.start.stages import (
    BETWEEN_SENSORS,
    SAME,
    effects_between_sensors,
    quicker_than_sensor,
    staged_start,
    with_friction_of,
)
from shake_ros.settings import load_table


def test_friction_of_the_first_guess_counts_per_mass_and_leaves_the_rest() -> None:
    model = unknown_model()
    assert model.table is not None
    guess = model.table.with_values(
        {"body.table_mass": 400.0, "friction.coulomb_level": 40.0, "friction.stribeck_decay": 20.0}
    )
    bent = guess.with_values(
        {
            "body.table_mass": 800.0,
            "friction.coulomb_level": 1e-3,
            "friction.stribeck_decay": 300.0,
            "valve.underlap": 3e-3,
        }
    )
    anew = with_friction_of(guess, bent, model)
    assert anew.value("friction.coulomb_level") == pytest.approx(80.0)
    assert anew.value("friction.stribeck_decay") == 20.0
    assert anew.value("valve.underlap") == 3e-3


def test_what_shows_between_the_sensors_is_on_the_table_where_it_may_lack_it() -> None:
    table = load_table("bergamo")
    base = BaseMode(compliance_mass=2e-5, frequency=18.0, damping=0.05)
    shown = effects_between_sensors(table, SensorPair(position_lag=0.01, scale_error=0.05, base=base), BETWEEN_SENSORS)
    assert shown["effects.position_sensor_lag.time_constant"] == 0.01
    assert shown["effects.accelerometer_scale.error"] == 0.05
    assert shown["effects.base_flexibility.compliance"] * table.moved_mass == pytest.approx(2e-5)
    assert "effects.accelerometer_lag.time_constant" not in shown
    assert effects_between_sensors(table, SensorPair(lag=0.01, scale_error=0.01), ("position_sensor_lag",)) == {}


def test_null_shift_that_the_free_run_tells_leaves_what_else_was_taken_out() -> None:
    before = Nuisance("run", 0.001, 0.1, glitches=7)
    data = Prepared([foreign_run(425)], [], 1.0, (before,))
    told = null_shifts(unknown_model(), load_table("bergamo"), data.estimation)
    (after,) = data.with_nuisances(NuisanceEstimates(shifts=told)).nuisances
    assert after.null_shift != before.null_shift
    assert (after.acceleration_bias, after.glitches) == (0.1, 7)


@pytest.mark.parametrize("second", [0.5 * SAME, 1.5 * SAME])
def test_a_second_guess_whose_predictor_runs_end_no_better_is_not_fitted(
    second: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, other = load_table("bergamo"), load_table("bergamo").with_values({"body.table_mass": 1e3})
    arrived = list[float]()

    def predictor_start(_problem: Any, free: FreeParameters, *_: Any, **__: Any) -> Any:
        return SimpleNamespace(predictor_cost=1.0 if free.base is first else second, start=free.base)

    def end(_problem: Any, _free: Any, way: Any, **_: Any) -> Any:
        arrived.append(way.predictor_cost)
        return SimpleNamespace(cost=2.0 if way.start is first else 1.0, table=way.start)

    monkeypatch.setattr(stages, "predictor_start", predictor_start)
    monkeypatch.setattr(stages, "arrived", end)
    monkeypatch.setattr(stages, "leaves_much", lambda *_: True)
    found = stages._best_of(RecordingProblem([], unknown_model()), (), (first, other))
    assert arrived == ([1.0, second] if second < SAME else [1.0])
    assert found.table is (other if second < SAME else first)


def test_what_the_sensors_show_stays_known_to_the_search_as_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    run = foreign_run(422)
    left = np.exp(-run.sample_time / 0.04)
    late = replace(run, position=lfilter([1.0 - left], [1.0, -left], run.position))
    monkeypatch.setattr(stages, "_best_of", lambda _pieces, _free, guesses: SimpleNamespace(cost=1.0, table=guesses[0]))
    monkeypatch.setattr(stages, "better_filter", lambda *_: None)
    monkeypatch.setattr(stages, "estimated_null_shifts", lambda *_: {})
    monkeypatch.setattr(stages, "leaves_much", lambda *_: False)
    monkeypatch.setattr(stages, "with_lag_parted", lambda _pieces, found, _tolerance: found)
    effects = {c.effect: c.free for c in effect_candidates()}
    start = staged_start(unknown_model(), (), lambda _: effects, prepared([late], []))
    assert start.between == ("position_sensor_lag",)
    assert model_structure(start).between == start.between


def test_a_table_quicker_than_its_accelerometer_has_an_early_position() -> None:
    lag = {"valve.natural_frequency": 200.0, "valve.damping": 0.8, "effects.command_delay.delay": 2e-3}  # 8 + 2 ms
    table = load_table("bergamo").with_values(lag)
    assert quicker_than_sensor(table, 0.0105)
    assert not quicker_than_sensor(table, 0.0095)
