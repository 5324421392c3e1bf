"""The search over sets: what it names on tables that the package did not simulate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hidden_table import SAMPLE_TIME, Hidden, record
from scipy.signal import bilinear, butter, lfilter

from benchmarks.discovery import hidden_tables
from shake_ros.declared import effect_candidates, model_structure
from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import start_of
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment, pieces
from shake_ros.fit.solver import Budget
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.physics.plant.sensors import FILTER_DELAY
from shake_ros.search.answer import DECLARED, answer, beginning, null_shifts
from shake_ros.search.candidates import listed
from shake_ros.search.loop import LONG, Contender, SearchData, SetSearch, best_half, evidence
from shake_ros.search.proposal import linearised, proposals
from shake_ros.settings import load_table

AMONG = ("spool_deadband", "specimen_resonance", "asymmetric_flow_gain", "quadratic_drag", "supply_droop")


def named(hidden: Hidden, **limits: float) -> tuple[str, ...]:
    runs = []
    for seed in (1, 2):
        made = record(seed, 4.0, hidden)
        runs.append(Record(f"run{seed}", SAMPLE_TIME, made.commands, made.position, made.acceleration))
    structure = model_structure(load_table("bergamo").with_values({"body.specimen_mass": 200.0}))
    candidates = tuple(c for c in effect_candidates() if c.effect in AMONG)
    structure = type(structure)(structure.table, structure.free, structure.late, candidates)
    found = answer(structure, runs[:1], runs[1:], Budget(**limits), lambda _: None)
    return tuple(c.effect for c in found.effects)


def test_nothing_is_named_where_nothing_is_hidden() -> None:
    assert named(Hidden()) == ()


def test_two_effects_at_once_are_both_named() -> None:
    assert set(named(Hidden(dead_band=0.02, flexible_mass=150.0, flexible_frequency=5.0))) == {
        "spool_deadband",
        "specimen_resonance",
    }


@pytest.mark.parametrize(
    ("effect", "bent"),
    [
        ("dead_volume", {}),
        ("friction_asymmetry", {}),
        ("presliding_friction", {"friction.coulomb_level": 1e-3, "friction.stribeck_rise": 0.0}),
    ],
)
def test_what_other_parameters_nearly_compensate_is_proposed_first(effect: str, bent: Mapping[str, float]) -> None:
    """Bulk modulus stands for most of a dead volume, friction that a fit has bent or made nothing hides its effects.

    bent : friction where the search begins, after a first fit to a table of which nothing is known.
    """
    commands = hidden_tables.excitations(2201, 0.3)
    truth = hidden_tables.with_effect(hidden_tables.declared_truth(2201), effect, 0.3, commands, 2201)
    runs = []
    for name, command in commands.items():
        made = hidden_tables.record(truth, command, 1.0, np.random.default_rng(3))
        runs.append(Record(name, hidden_tables.SAMPLE, made["command"], made["position"], made["acceleration"]))
    structure = model_structure(load_table("bergamo"))
    structure = replace(structure, table=structure.table.with_values(bent), unbent=structure.table)
    sets = ([r for r in runs if r.name.startswith(role)] for role in ("learn", "hold"))
    data = SearchData(*(Predictor([Segment.of(r) for r in pieces(found, 8.0, 3.5)], Levels()) for found in sets))
    search = SetSearch(data, [listed(c) for c in structure.candidates], Budget(), lambda _: None)
    declared = search.scored(beginning(structure, {}, 0.0), LONG, data, DECLARED)
    absent = linearised(declared.fitted, search.listed, beside=(declared.seen,))
    assert proposals(absent, 1)[1][0].names == (effect,)


def test_what_could_stand_in_the_place_of_an_effect_is_named_beside_it() -> None:
    runs = [record(seed, 4.0, mass=750.0) for seed in (1, 2)]
    given = [Record(f"run{i}", SAMPLE_TIME, r.commands, r.position, r.acceleration) for i, r in enumerate(runs)]
    structure = model_structure(load_table("bergamo"))
    among = ("payload_error", "tank_back_pressure", "spool_deadband")
    structure = replace(structure, candidates=tuple(c for c in structure.candidates if c.effect in among))
    found = answer(structure, given[:1], given[1:], Budget(), lambda _: None)
    (effect,) = found.effects
    (other,) = (candidate.effect for candidate, _ in found.rivals[effect.effect])
    assert {effect.effect, other} == {"payload_error", "tank_back_pressure"}


def test_null_shift_of_a_recording_is_the_mean_of_what_its_segments_show() -> None:
    made = record(1, 4.0)
    learnt = replace(Record("learn", SAMPLE_TIME, made.commands, made.position, made.acceleration), shift=1e-3)
    held = replace(learnt, name="hold", shift=0.0)
    halves = [Segment.of(learnt.part(slice(first, first + 2000))) for first in (0, 2000)]
    begun = SearchData(Predictor(halves, Levels()), Predictor([Segment.of(held)], Levels()))
    moved = [half.shifted(shift) for half, shift in zip(halves, (2e-3, 4e-3), strict=True)]
    found = SearchData(Predictor(moved, Levels()), Predictor([Segment.of(held).shifted(-5e-3)], Levels()))
    assert null_shifts(begun, found, [learnt, held]) == pytest.approx({"learn": 4e-3, "hold": -5e-3})


def test_search_whose_time_is_over_gives_the_declared_table() -> None:
    assert named(Hidden(dead_band=0.02), seconds=0.0) == ()


@pytest.mark.parametrize(("fitted", "validation", "counts"), [(2.0, 2.0, True), (0.0, 4.0, False), (4.0, -4.0, False)])
def test_gain_of_the_validation_data_alone_is_no_evidence(fitted: float, validation: float, counts: bool) -> None:
    def scored(effects: int, gain: float, other: float) -> Any:
        prediction = SimpleNamespace(count=1000)
        model = SimpleNamespace(effects=["effect"] * effects, x=np.zeros(5 + effects))
        blocks = np.full(12, gain)
        return SimpleNamespace(
            model=model,
            fitted=SimpleNamespace(prediction=prediction, likelihood=blocks),
            count=2000,
            seen=SimpleNamespace(floor=0.0),
            by_block=np.concatenate([blocks, np.full(12, other)]),
        )

    assert (evidence(scored(1, fitted, validation), scored(0, 0.0, 0.0)) > 0.0) is counts


def test_a_model_without_an_effect_is_fitted_from_where_the_one_with_it_stands() -> None:
    """A declared model that got stuck far off would make any effect look needed."""
    runs = [
        Record(f"run{s}", SAMPLE_TIME, m.commands, m.position, m.acceleration) for s in (1, 2) for m in [record(s, 4.0)]
    ]
    structure = model_structure(load_table("bergamo"))
    sets = (Predictor([Segment.of(r) for r in pieces([run], 4.0, 3.5)], Levels()) for run in runs)
    search = SetSearch(SearchData(*sets), [], Budget(), lambda _: None)
    declared = start_of(structure.table, (*structure.free, *structure.late))
    stuck = search.scored(declared.at(3.0 * declared.x), 0, search.data, Levels(force=3.0))
    slow = next(listed(c) for c in effect_candidates() if c.effect == "slow_valve")
    *_, better = search.run(declared.with_effect(slow, {slow.strength.name: slow.strength.scale}), DECLARED)
    assert better.model.effects == ()
    assert better.fitted.total > stuck.fitted.total + 1000.0


def contender(names: str, left: float, gain: float) -> Contender:
    return Contender(SimpleNamespace(names=tuple(names)), SimpleNamespace(), left, gain)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("field", "kept"),
    [
        ([("a", 1.0, 9.0), ("b", 1.1, 8.0), ("c", 1.2, 7.0), ("d", 1.3, 6.0)], ["a", "b", "c"]),
        ([(name, 1.0, 9.0 - i) for i, name in enumerate("abcdefgh")], ["a", "b", "c", "d"]),
        ([("a", 2.0, 5.0), ("ab", 1.9, 5.1)], ["a"]),
        ([("a", 2.0, 5.0), ("ab", 1.5, 8.0)], ["ab"]),
        ([("ab", 1.0, 9.0), ("b", 1.1, 8.0), ("c", 1.2, 1.0)], ["ab", "c"]),
        ([("a", 1.0, 9.0), ("b", 1.6, 8.0)], ["a"]),
        ([], []),
    ],
    ids=["a few at least", "half", "hardly more than a part", "more than a part", "nothing new", "far worse", "nobody"],
)
def test_which_sets_are_fitted_further(field: list[tuple[str, float, float]], kept: list[str]) -> None:
    assert ["".join(c.of.names) for c in best_half([contender(*c) for c in reversed(field)])] == kept


def test_a_lag_that_the_first_fit_has_taken_for_the_filter_is_named() -> None:
    """An accelerometer with a lag of 2 ms behind a filter of 200 Hz, which the first fit has taken for one filter."""
    lag, delay = 2e-3, FILTER_DELAY / 200.0
    smooth, slow = butter(2, 200.0, fs=1.0 / SAMPLE_TIME), bilinear([1.0], [lag, 1.0], 1.0 / SAMPLE_TIME)
    runs = []
    for seed in (1, 2):
        made = record(seed, 4.0, Hidden())
        felt = lfilter(*slow, lfilter(*smooth, made.acceleration))
        felt += 0.05 * np.random.default_rng(seed).standard_normal(len(felt))
        late = {"delay": delay + lag, "cutoff": FILTER_DELAY / (delay + lag)}
        runs.append(Record(f"run{seed}", SAMPLE_TIME, made.commands, made.position, felt, **late))
    structure = model_structure(load_table("bergamo").with_values({"body.specimen_mass": 200.0}))
    among = ("accelerometer_lag", "base_flexibility", "soft_zone")
    candidates = tuple(c for c in effect_candidates() if c.effect in among)
    structure = replace(structure, simulator=UnknownModel(structure.table), candidates=candidates)
    found = answer(structure, runs[:1], runs[1:], Budget(), lambda _: None)
    assert [c.effect for c in found.effects] == ["accelerometer_lag"]
    assert found.nuisances.behind is not None
    assert found.nuisances.behind.by_filter == pytest.approx(delay, abs=4e-4)
    assert found.table.value("effects.accelerometer_lag.time_constant") == pytest.approx(lag, abs=4e-4)
