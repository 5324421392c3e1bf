"""The list of effects that a search tries."""

from __future__ import annotations

import pytest

from shake_ros.declared import effect_candidates
from shake_ros.physics.effects import EFFECTS, PLACES
from shake_ros.physics.plant.parameters import FIELDS
from shake_ros.quantities import ShakeError
from shake_ros.search.candidate_effects import CandidateEffect, candidates, scaled
from shake_ros.settings import load_table

POOL = effect_candidates()
LISTED = """
    spool_deadband spool_hysteresis asymmetric_flow_gain valve_null_shift slow_valve turbulent_leakage
    supply_droop tank_back_pressure pressure_dependent_bulk_modulus entrained_air soft_zone dead_volume
    friction_asymmetry position_dependent_friction presliding_friction film_friction quadratic_drag
    constant_force stiffness_to_ground specimen_resonance coupling_backlash base_flexibility payload_error
    accelerometer_scale accelerometer_bias accelerometer_lag position_sensor_lag command_delay
"""


def test_every_listed_effect_that_the_full_model_may_lack_is_tried() -> None:
    assert sorted(c.effect for c in POOL) == sorted(LISTED.split())


@pytest.mark.parametrize("candidate", POOL, ids=lambda c: c.effect)
def test_candidate_is_absent_at_its_neutral_value_and_present_in_every_trial(candidate: CandidateEffect) -> None:
    assert candidate.place in PLACES
    assert candidate.strength.name == f"effects.{candidate.effect}." + next(iter(FIELDS_OF[candidate.effect]))
    assert load_table("bergamo").value(candidate.strength.name) == candidate.neutral
    assert candidate.strength.low <= candidate.neutral <= candidate.strength.high
    assert candidate.trials
    own = {f.name: f for f in candidate.free}
    for trial in candidate.trials:
        table = load_table("bergamo").with_values(trial)
        assert set(table.effects) == {candidate.effect}
        assert any(trial[name] != FIELDS[name].default for name in trial)
        assert all(own[name].low <= value <= own[name].high for name, value in trial.items())


FIELDS_OF = {name: [f.rpartition(".")[2] for f in FIELDS if f.startswith(f"effects.{name}.")] for name in EFFECTS}


def test_sign_of_an_effect_is_free_where_both_sides_of_its_absence_have_a_meaning() -> None:
    signed = {c.effect for c in POOL if c.signed}
    assert {"asymmetric_flow_gain", "valve_null_shift", "constant_force", "payload_error"} <= signed
    assert not signed & {"soft_zone", "spool_deadband", "command_delay", "specimen_resonance"}


FREE = {"depth": {"scale": 0.1}}


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ({"soft_zon": {}}, "did you mean 'soft_zone'"),
        ({"soft_zone": {"free": FREE}}, "soft_zone: needs the keys 'free' and 'trials'"),
        ({"soft_zone": {"free": FREE, "trials": [{"dept": 0.5}]}}, "did you mean 'effects.soft_zone.depth'"),
        ({"soft_zone": {"free": FREE, "trials": [], "usual": {"dept": [0.0, 0.5]}}}, "did you mean 'effects.soft_zone"),
        ({"soft_zone": {"free": FREE, "trials": [], "usual": {"depth": 0.5}}}, "soft_zone: usual: needs [low, high]"),
        ({"soft_zone": {"free": {"depth": {}}, "trials": []}}, "needs a number 'scale'"),
        ({"soft_zone": {"free": FREE, "trials": [], "narrow": [1]}}, "narrow: [1] is neither true nor false"),
    ],
)
def test_wrong_list_is_one_line_that_names_the_file(content: dict, text: str) -> None:
    with pytest.raises(ShakeError, match=r"effects\.yaml") as caught:
        candidates(content, "effects.yaml")
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_trials_follow_the_size_of_the_table() -> None:
    reference = load_table("bergamo")
    small = reference.with_values({"body.table_mass": 0.1 * reference.moved_mass, "body.specimen_mass": 0.0})
    for candidate in POOL:
        same = scaled(candidate, reference, reference)
        assert same.trials == candidate.trials, candidate.effect
        assert [f.scale for f in same.free] == [f.scale for f in candidate.free]
    by_name = {c.effect: scaled(c, small, reference) for c in POOL}
    first = {c.effect: c for c in POOL}

    def ratio(effect: str) -> float:
        name = first[effect].strength.name
        return by_name[effect].trials[-1][name] / first[effect].trials[-1][name]

    for effect in ("specimen_resonance", "quadratic_drag", "stiffness_to_ground", "constant_force"):
        assert ratio(effect) == pytest.approx(0.1), effect
    assert ratio("base_flexibility") == pytest.approx(10.0)
    for effect in ("spool_deadband", "turbulent_leakage", "supply_droop", "soft_zone", "accelerometer_lag"):
        assert ratio(effect) == pytest.approx(1.0), effect


def test_scaled_trials_stay_within_the_bounds_of_their_quantities() -> None:
    reference = load_table("bergamo")
    huge = reference.with_values({"body.table_mass": 1e3 * reference.moved_mass, "body.piston_area": 0.3})
    for candidate in (scaled(c, huge, reference) for c in POOL):
        for trial in candidate.trials:
            for name, value in trial.items():
                assert FIELDS[name].metadata["low"] <= value <= FIELDS[name].metadata["high"], name
