"""Laws tried on a table: the horizon of its virtual table, what counts of a trial, and which law is recommended."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from shake_ros.control.laws.law import LawParameters
from shake_ros.control.laws.virtual_table import VirtualTable
from shake_ros.control.robust import Design, RobustSettings
from shake_ros.control.trials import Trial, TriedLaw, horizon
from shake_ros.recordings.reference_file import build_program
from shake_ros.settings import find, load_table, read_yaml

SETTINGS = RobustSettings.from_mapping(read_yaml(find("robust_tuning", "default"))["numbers"], "default")
DT = SETTINGS.sample_time


@pytest.fixture(scope="module")
def earthquake() -> NDArray[np.float64]:
    return build_program("earthquake", DT).samples(0, 3000)


def test_a_table_with_little_friction_gets_the_shortest_horizon(earthquake: NDArray[np.float64]) -> None:
    assert horizon(load_table("bergamo"), earthquake, SETTINGS) == SETTINGS.model_horizon


def test_strong_friction_gets_a_horizon_that_bears_the_rate_of_the_command(earthquake: NDArray[np.float64]) -> None:
    """1.8 kN of dry friction: the shortest horizon makes the valve jump from stop to stop, or rings within the rate."""
    table, bandwidth = load_table("bergamo_measured"), SETTINGS.model_bandwidth
    found = horizon(table, earthquake, SETTINGS)
    assert SETTINGS.model_horizon < found < 0.008

    def follow(seconds: float, rate: float) -> tuple[float, float]:
        commands, motion = VirtualTable(table, DT, bandwidth, seconds, 1.0, rate=rate).follow(earthquake)
        missed = np.std(motion[:, 2] - earthquake[:, 2]) / np.std(earthquake[:, 2])
        return float(np.max(np.abs(np.diff(commands)))), float(missed)

    jump, missed = follow(found, SETTINGS.model_rate)
    assert jump <= SETTINGS.model_rate * DT * (1.0 + 1e-9)
    assert missed < 0.2
    assert follow(SETTINGS.model_horizon, 1e5)[0] > 0.9
    assert follow(SETTINGS.model_horizon, SETTINGS.model_rate)[1] > 1.0


def law(kind: str, *errors: tuple[float, float, float], rings: float = 0.5) -> TriedLaw:
    """Errors in parts of what is wanted, on the table and its neighbours."""
    wanted = np.array([0.005, 0.03, 0.15])
    trials = tuple(Trial(np.array(e) * wanted, 0.1, 0.0, 0.0, 0.3, 0.05) for e in errors)
    return TriedLaw(kind, cast(LawParameters, None), cast(Design, None), trials, rings, 1.0)


def test_a_neighbour_on_which_every_law_fails_does_not_choose_among_them() -> None:
    good = law("good", (1.0, 1.0, 1.0), (3.0, 3.0, 10.0))
    poor = law("poor", (4.0, 4.0, 4.0), (3.0, 3.0, 9.5))
    assert good.behind([good, poor]) == pytest.approx(0.5)
    assert poor.behind([good, poor]) == pytest.approx(3.0)
    assert poor.score < good.score


def test_errors_below_what_is_wanted_are_alike_and_a_loop_that_rings_is_behind_all() -> None:
    first, second = law("first", (0.1, 0.1, 0.1)), law("second", (0.9, 0.9, 0.9))
    assert second.behind([first, second]) == 0.0
    assert law("rings", (0.1, 0.1, 0.1), rings=1.2).behind([first]) == np.inf
