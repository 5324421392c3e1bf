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
from shake_ros.fit.free_parameters import FreeParameter, FreeParameters
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.nuisances.estimates import NuisanceEstimates, null_shifts
from shake_ros.fit.nuisances.prepared import Nuisance, Prepared, prepared
from shake_ros.fit.nuisances.sensor_pair import BaseMode, SensorPair
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.start import stages
from shake_ros.fit.start.narrow_valleys import FALL
from shake_ros.fit.start.stages import (
    BETWEEN_SENSORS,
    SAME,
    effects_between_sensors,
    from_narrow_start,
    quicker_than_sensor,
    several_at_once,
    shows_at_once,
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


@pytest.mark.parametrize("left", [3.0, 5.0])
def test_backlash_is_fitted_from_starts_of_its_own_where_these_are_not_hopeless(
    left: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    backlash = next(c for c in effect_candidates() if c.effect == "coupling_backlash")
    gap = "effects.coupling_backlash.gap"
    seen: list[Any] = []

    def from_slow_to_fast(
        _problem: Any, free: FreeParameters, starts: list[np.ndarray], own: list[str], most: float
    ) -> np.ndarray:
        seen.append((sorted({round(float(x[free.names.index(gap)]), 9) for x in starts}), own, most))
        friction.extend({float(x[free.names.index(viscous.name)]) for x in starts})
        return starts[3]

    def fit(_problem: Any, free: FreeParameters, start: np.ndarray, **_: Any) -> Any:
        return SimpleNamespace(cost=2.0, table=free.table(start))

    monkeypatch.setattr(stages, "from_slow_to_fast", from_slow_to_fast)
    monkeypatch.setattr(stages, "fit", fit)
    monkeypatch.setattr(stages, "RecordingProblem", lambda records, _model: SimpleNamespace(count=records))
    monkeypatch.setattr(stages, "windows", lambda *_: 1)
    residuals = SimpleNamespace(residuals=lambda rows: np.full((len(rows), 2), np.sqrt(left)))
    pieces: Any = SimpleNamespace(**vars(residuals), records=[], model=None, count=2)
    viscous = FreeParameter("friction.viscous", 100.0, 0.0, 1e5, "N*s/m")
    begin, friction = load_table("bergamo"), list[float]()
    without = FreeParameters(begin.with_values({viscous.name: 777.0}), [viscous])
    before = Fit(without, without.start(), np.zeros(1), np.zeros((1, 1)), 9.0, 1)
    found = from_narrow_start(pieces, [viscous, *backlash.free], backlash, begin, before, most=2.0)
    gaps, own, useful = seen[0]
    assert gaps == [0.2, 0.5, 1.0, 2.0, 4.0]  # in its scale of 0.1 mm
    assert sorted(friction) == pytest.approx([begin.value(viscous.name) / 100.0, 7.77])  # of the guess and of the fit
    assert [name.rpartition(".")[2] for name in own] == ["rod_mass", "stiffness", "gap"]
    assert useful == 1.0  # of half as many residuals
    if left > FALL * 2.0:
        assert found is None
    else:
        assert found is not None and found.table.value(gap) == 5e-5


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


@pytest.mark.parametrize(("gap", "shows"), [(1e-4, True), (0.0, False)])
def test_backlash_shows_at_once_where_it_alone_lowers_what_is_left_of_slow_motion(gap: float, shows: bool) -> None:
    backlash = next(c for c in effect_candidates() if c.effect == "coupling_backlash")
    free = FreeParameters(load_table("bergamo"), ())
    column = [*free.base.fields].index("effects.coupling_backlash.gap")
    slow_motion = SimpleNamespace(residuals=lambda rows: 1e4 * (rows[:, [column]] - gap))
    pieces: Any = SimpleNamespace(below=lambda *_: slow_motion)
    before = Fit(free, np.zeros(0), np.zeros(1), np.zeros((1, 0)), 1.0, 1)
    assert shows_at_once(pieces, backlash, before) is shows


def test_backlash_that_shows_at_once_is_sought_first(monkeypatch: pytest.MonkeyPatch) -> None:
    backlash = next(c for c in effect_candidates() if c.effect == "coupling_backlash")
    base = load_table("bergamo")
    monkeypatch.setattr(stages, "shows_at_once", lambda *_: True)
    monkeypatch.setattr(stages, "joint_start", lambda *_: pytest.fail("joined"))
    found: Any = SimpleNamespace(cost=1.0)
    monkeypatch.setattr(stages, "from_narrow_start", lambda *_: found)
    before: Any = SimpleNamespace(cost=5.0)
    pieces: Any = SimpleNamespace()
    assert several_at_once(pieces, [], {"coupling_backlash": backlash}, base, before) == (found, ("coupling_backlash",))
    before.cost = 1.5  # of which it leaves more than half
    monkeypatch.setattr(stages, "joint_start", lambda *_: (base, ()))
    monkeypatch.setattr(stages, "leaves_much", lambda *_: False)
    asked = list[float]()
    monkeypatch.setattr(stages, "from_narrow_start", lambda *a: asked.append(a[-1]) or found)
    assert several_at_once(pieces, [], {"coupling_backlash": backlash}, base, before) == (before, ())
    assert asked == [0.75]  # half of that, and not once more


@pytest.mark.parametrize(
    ("cost", "left", "depth", "alone", "taken"),
    [
        (0.5 * 1.5**2, 0.05, 0.97, 0.1, False),  # near the noise a bound does not matter
        (0.5 * 3.0**2, 0.05, 0.5, 0.1, False),
        (0.5 * 3.0**2, 0.05, 0.97, 0.45, True),  # on its bound, and much is left
        (0.5 * 6.0**2, 0.05, 0.5, 0.45, True),
        (0.5 * 6.0**2, 0.05, 0.5, 0.55, False),  # little better than what joined
        (0.5 * 6.0**2, 0.02, 0.97, 0.1, False),  # of so much as was taken backlash takes no part
        (0.5 * 1.5**2, 0.2, 0.5, 0.45, True),
        (0.5 * 6.0**2, 0.9, 0.5, 0.3, False),  # far better, but it leaves more than a quarter of all
    ],
)
def test_backlash_is_kept_where_the_joint_fit_is_no_answer_and_it_leaves_far_less(
    cost: float, left: float, depth: float, alone: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    zone, backlash = (next(c for c in effect_candidates() if c.effect == e) for e in ("soft_zone", "coupling_backlash"))
    free = FreeParameters(load_table("bergamo").with_values(zone.trials[0]), zone.free)
    joined = Fit(free, free.x_of({"effects.soft_zone.depth": depth}), np.zeros(1), np.zeros((1, 3)), cost, 1)
    other: Any = SimpleNamespace(cost=alone * cost)
    pieces: Any = SimpleNamespace(noise_cost=lambda: 1.0, count=1)
    monkeypatch.setattr(stages, "joint_start", lambda *_: (free.base, ("soft_zone",)))
    monkeypatch.setattr(stages, "_fitted", lambda *_: joined)
    monkeypatch.setattr(stages, "from_narrow_start", lambda *_: other)
    monkeypatch.setattr(stages, "shows_at_once", lambda *_: False)
    known = {c.effect: c for c in (zone, backlash)}
    before: Any = SimpleNamespace(cost=cost / left)
    found, effects = several_at_once(pieces, [], known, load_table("bergamo"), before)
    assert (found is other, effects) == ((True, ("coupling_backlash",)) if taken else (False, ("soft_zone",)))


@pytest.mark.parametrize(("over", "asked"), [(4.0, 1), (6.0, 2)])
def test_friction_with_a_memory_joins_only_where_others_leave_a_table_far(
    over: float, asked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = {c.effect: c for c in effect_candidates() if c.effect in ("presliding_friction", "soft_zone")}
    free = FreeParameters(load_table("bergamo"), ())
    left = {False: 0.5 * over**2, True: 0.5 * 1.2**2}
    seen = list[bool]()

    def joint_start(*arguments: Any) -> tuple[Any, tuple[str, ...]]:
        seen.append(arguments[-1])
        return free.base, ("presliding_friction",) if arguments[-1] else ("soft_zone",)

    def fitted(*_: Any) -> Fit:
        return Fit(free, np.zeros(0), np.zeros(1), np.zeros((1, 0)), left[seen[-1]], 1)

    pieces: Any = SimpleNamespace(noise_cost=lambda: 1.0, count=1)
    monkeypatch.setattr(stages, "joint_start", joint_start)
    monkeypatch.setattr(stages, "_fitted", fitted)
    before: Any = SimpleNamespace(cost=0.5 * 20.0**2)
    found, effects = several_at_once(pieces, [], known, free.base, before)
    assert seen == [False, True][:asked]
    assert (found.cost, effects) == (
        (left[True], ("presliding_friction",)) if asked > 1 else (left[False], ("soft_zone",))
    )


def test_backlash_is_not_sought_on_a_table_that_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    backlash = next(c for c in effect_candidates() if c.effect == "coupling_backlash")
    free = FreeParameters(load_table("bergamo").with_values(backlash.trials[0]), ())
    before = Fit(free, np.zeros(0), np.zeros(1), np.zeros((1, 0)), 18.0, 1)
    pieces: Any = SimpleNamespace(noise_cost=lambda: 1.0, count=1)
    monkeypatch.setattr(stages, "joint_start", lambda *_: (free.base, ()))
    monkeypatch.setattr(stages, "_fitted", lambda *_: pytest.fail("fitted once more"))
    monkeypatch.setattr(stages, "from_narrow_start", lambda *_: pytest.fail("sought"))
    assert several_at_once(pieces, [], {"coupling_backlash": backlash}, free.base, before) == (before, ())


def test_what_the_sensors_show_stays_known_to_the_search_as_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    run = foreign_run(422)
    left = np.exp(-run.sample_time / 0.04)
    late = replace(run, position=lfilter([1.0 - left], [1.0, -left], run.position))
    monkeypatch.setattr(stages, "_best_of", lambda _pieces, _free, guesses: SimpleNamespace(cost=1.0, table=guesses[0]))
    monkeypatch.setattr(stages, "better_filter", lambda *_: None)
    monkeypatch.setattr(stages, "estimated_null_shifts", lambda *_: {})
    monkeypatch.setattr(stages, "leaves_much", lambda *_: False)
    monkeypatch.setattr(stages, "with_lag_parted", lambda _pieces, found, _tolerance: found)
    effects = {c.effect: c for c in effect_candidates()}
    start = staged_start(unknown_model(), (), lambda _: effects, prepared([late], []))
    assert start.between == ("position_sensor_lag",)
    assert model_structure(start).between == start.between


def test_a_table_quicker_than_its_accelerometer_has_an_early_position() -> None:
    lag = {"valve.natural_frequency": 200.0, "valve.damping": 0.8, "effects.command_delay.delay": 2e-3}  # 8 + 2 ms
    table = load_table("bergamo").with_values(lag)
    assert quicker_than_sensor(table, 0.0105)
    assert not quicker_than_sensor(table, 0.0095)
