"""Required spectra: a code's own control points, a user's refusals; what an assessment counts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.qualification.asked import load_rules, load_settings
from shake_ros.qualification.assessment import arias_times, assess, longest_run, strong_part
from shake_ros.qualification.motion import check_sampling, demand, refusal, synthesise
from shake_ros.qualification.required import GRAVITY, Ac156, load_required, required_from
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table
from shake_ros.signals.response_spectrum import response_spectrum

STEP = 0.001
USER: dict[str, Any] = {
    "kind": "points", "name": "floor", "source": "none", "rules": "ieee_344", "damping": 0.02, "zero_period": None,
    "points": [[1.0, 2.0], [4.0, 8.0]],
}  # fmt: skip


def test_ac156_has_its_plateau_and_its_rigid_end() -> None:
    required, rules = load_required("ac156")
    assert rules == "ac156"
    np.testing.assert_allclose(required.at(np.array([1.3, 5.0, 8.3, 33.3])), GRAVITY * np.array([1, 1, 1, 0.4]))
    roof = Ac156("asce_7_16", "horizontal", 1.0, 1.0, 0.0, 1.0, "", "").required()
    np.testing.assert_allclose(roof.levels, GRAVITY * np.array([1.6, 1.6, 1.2]))


def test_rg_1_60_at_five_percent_has_the_factors_of_its_table() -> None:
    required, _ = load_required("rg_1_60")
    np.testing.assert_allclose(required.at(np.array([2.5, 9.0, 33.0])), 0.1 * GRAVITY * np.array([3.13, 2.61, 1.0]))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"points": [[4.0, 2.0], [1.0, 8.0]]}, "1 Hz comes after 4 Hz; sort them"),
        ({"points": [[1.0, 2.0], [4.0, float("nan")]]}, "pair 2"),
        ({"damping": 0.0}, "damping = 0.0 is not within"),
        ({"points": [[1.0, 2.0]]}, "at least two pairs"),
        ({"kind": "ac157"}, "kind 'ac157' is not known"),
    ],
)
def test_a_spectrum_that_is_none_is_refused_with_its_line(change: dict[str, Any], said: str) -> None:
    with pytest.raises(ShakeError, match=r"floor\.yaml") as told:
        required_from(USER | change, "floor.yaml")
    assert said in str(told.value)


def test_a_sampling_rate_too_low_is_refused() -> None:
    with pytest.raises(ShakeError, match="needs at least 125 samples per second; there are 50"):
        check_sampling(load_required("ac156")[0], 0.02)


def test_a_synthesised_motion_passes_its_own_rules_and_ends_at_rest() -> None:
    required, name = load_required("ac156")
    table, rules, settings = load_table("bergamo"), load_rules(name), load_settings("default")
    parameters = settings.motion_for(rules).replace(seeds=1)
    motion = synthesise(required, table, parameters, STEP, seed=1)
    states = states_from_rest(motion, STEP)
    assert assess(motion, STEP, required, rules).passed
    assert np.abs(states[-1, :2]).max() < 1e-6  # m, m/s
    assert abs(states[-1, 2]) < 1e-4  # m/s²: the correction of the base line does not end at zero
    assert refusal(states, table, parameters) == ""
    told = refusal(3.0 * states, table, parameters)
    assert "times the velocity that the table may use; the same RRS scaled by 0." in told
    fits = float(told.split("scaled by ")[1].split()[0])
    assert max(demand(3.0 * fits * states, table, parameters)) <= 1.0


def test_points_below_are_counted_and_so_are_their_neighbours() -> None:
    required, _ = load_required("ac156")
    rules = load_rules("ac156")
    t = np.arange(20_000) * STEP
    still = 1e-3 * np.sin(2.0 * np.pi * 3.0 * t) * np.sin(np.pi * t / t[-1]) ** 2
    verdicts = {v.rule.split(" (")[0]: v for v in assess(still, STEP, required, rules).verdicts}
    assert verdicts["points of the TRS below the RRS"].measured == "30"
    assert verdicts["adjacent points below"].passed is False
    assert longest_run(np.array([True, True, False, True])) == 2


def test_strong_part_and_arias_duration_of_a_plateau() -> None:
    t = np.arange(30_000) * STEP
    a = np.where((t >= 5.0) & (t < 25.0), np.sin(2.0 * np.pi * 5.0 * t), 0.0)
    first, last = strong_part(a, 0.25)
    assert (last - first) * STEP == pytest.approx(20.0, abs=0.1)
    five, much = arias_times(a, STEP)
    assert much - five == pytest.approx(14.0, abs=0.1)


def test_an_oscillator_at_rest_has_no_spectrum() -> None:
    assert response_spectrum(np.zeros(100), STEP, np.array([5.0]), 0.05).acceleration[0] == 0.0
