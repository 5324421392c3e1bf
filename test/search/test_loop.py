"""The search over sets: what it names on tables that the package did not simulate."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_table import SAMPLE_TIME, Hidden, record

from shake_ros.api.close_loop import close_loop
from shake_ros.api.model import model
from shake_ros.core.identification.recordings import Record
from shake_ros.core.quantities import ShakeError
from shake_ros.declared import effect_candidates, model_structure
from shake_ros.fit.solver import Budget
from shake_ros.search.answer import answer
from shake_ros.search.loop import tempered
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


def test_search_whose_time_is_over_gives_the_declared_table() -> None:
    assert named(Hidden(dead_band=0.02), seconds=0.0) == ()


def test_gain_that_varies_from_block_to_block_counts_less() -> None:
    steady, wild = np.full(50, 2.0), np.where(np.arange(50) % 2 == 0, 52.0, -48.0)
    assert tempered(steady, np.zeros(50)) == pytest.approx(100.0)
    assert tempered(wild, np.zeros(50)) < 1.0
    assert tempered(np.zeros(50), steady) == pytest.approx(-100.0)


def test_search_over_sets_is_refused_for_a_model_that_it_does_not_have() -> None:
    with pytest.raises(ShakeError, match="the search sets is for the declared model full, not for reduced"):
        close_loop(model("reduced"), [], [], search="sets", progress=False)
