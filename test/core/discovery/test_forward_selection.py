"""What the declared model lacks is named from short recordings of a table that the independent model simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_loops import DEAD_BAND, named

from shake_ros.core.discovery import forward_selection as forward
from shake_ros.core.discovery.problem import ModelStructure, Stopped
from shake_ros.core.identification.uncertainty import estimates
from shake_ros.settings import load_table

EFFECTS = ["spool_deadband", "soft_zone", "asymmetric_flow_gain"]
TRUTH = {  # what the hidden tables have, by the names of the parameters that the search frees
    "spool_deadband": {"effects.spool_deadband.width": DEAD_BAND},
    "soft_zone": {"effects.soft_zone.depth": 0.6},
    "asymmetric_flow_gain": {"effects.asymmetric_flow_gain.asymmetry": 0.1},
}


def test_nothing_is_named_where_nothing_is_missing() -> None:
    found = named("nothing")
    assert found.search.steps == ()
    assert found.search.final is found.search.declared
    assert found.search.final.validation_cost < 2.0 * found.problem.validation.noise_cost()


@pytest.mark.parametrize("case", EFFECTS)
def test_effect_that_the_table_has_is_the_one_named(case: str) -> None:
    steps = named(case).search.steps
    assert [s.chosen.candidate.effect for s in steps] == [case]
    assert steps[0].alternatives == ()


@pytest.mark.parametrize("case", EFFECTS[1:])  # the first one's search is over sets
def test_screening_already_puts_the_effect_first(case: str) -> None:
    screened = named(case).search.steps[0].screened
    assert screened[0].candidate.effect == case
    gains = [s.gain for s in screened]
    assert gains == sorted(gains, reverse=True)


@pytest.mark.parametrize("case", EFFECTS)
def test_values_of_the_effect_are_found(case: str) -> None:
    found = named(case)
    final = {e.name: e for e in estimates(found.search.final.fit, found.problem.estimation.blocks())}
    for name, value in TRUTH[case].items():
        assert final[name].value == pytest.approx(value, rel=0.05)


@pytest.mark.parametrize("case", EFFECTS)
def test_with_the_effect_the_held_out_recording_is_explained_down_to_its_noise(case: str) -> None:
    found = named(case)
    noise = found.problem.validation.noise_cost()
    assert found.search.declared.validation_cost > 30.0 * noise
    assert found.search.final.validation_cost < 2.5 * noise


@pytest.mark.parametrize("case", EFFECTS)
def test_ranking_goes_from_the_best_and_starts_with_the_chosen(case: str) -> None:
    step = named(case).search.steps[0]
    assert step.ranking[0] is step.chosen
    scores = [a.score for a in step.ranking]
    assert scores == sorted(scores)
    assert all(
        np.isfinite([a.result.estimation_cost, a.result.validation_cost, a.predicted_gain]).all() for a in step.ranking
    )


def test_specimen_of_another_mass_is_not_told_from_another_pressure_difference() -> None:
    steps = named("payload_error").search.steps
    assert len(steps) == 1
    group = {steps[0].chosen.candidate.effect, *steps[0].alternatives}
    assert group == {"payload_error", "tank_back_pressure"}


def test_search_whose_time_is_over_before_it_eliminates_answers_with_what_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def over(text: str, part: float) -> None:
        if text == "checking that every effect is needed":
            raise Stopped

    found = named("nothing")
    monkeypatch.setattr(forward, "stages", lambda *_: iter([found.search]))
    problem = replace(found.problem, progress=over)
    stopped = forward.forward_selection(problem, found.search.declared.fit, ModelStructure(load_table("bergamo"), ()))
    assert stopped.stopped
    assert stopped.final is found.search.final
