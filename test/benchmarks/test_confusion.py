"""benchmarks/discovery/confusion.py in short: effects hidden by another simulator are named, nothing is made up."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.discovery import confusion, hidden_tables

COMPETING = ("spool_deadband", "accelerometer_lag", "friction_asymmetry", "command_delay")


def measured(effect: str, size: float):
    return confusion.measure(effect, 1, 1.0, size, length=0.5, among=COMPETING)


@pytest.mark.second_tier
@pytest.mark.parametrize("effect", ["spool_deadband", "accelerometer_lag"])
def test_an_effect_hidden_by_another_simulator_is_named_and_little_but_noise_is_left(effect):
    row = measured(effect, 0.1)
    assert row["hit"]
    assert row["place_right"]
    assert row["over_noise"] < 1.5
    assert row["after"] < 0.5 * row["before"]


@pytest.mark.second_tier
def test_where_nothing_is_missing_nothing_is_named():
    row = measured("none", 0.0)
    assert row["named"] == []
    assert not row["false_alarm"]
    assert not row["above_noise"]


def test_the_strength_is_such_that_the_acceleration_changes_as_much_as_wanted():
    commands = hidden_tables.excitations(3, 0.3)
    base = hidden_tables.declared_truth(3)
    table = hidden_tables.with_effect(base, "spool_deadband", 0.1, commands, 3)
    assert hidden_tables.acceleration_change(base, table, commands) == pytest.approx(0.1, rel=0.1)


def test_the_hidden_tables_use_nothing_of_the_package():
    text = Path(hidden_tables.__file__).read_text(encoding="utf-8")
    assert "import shake_ros" not in text and "from shake_ros" not in text


def test_every_listed_effect_of_the_full_model_can_be_hidden():
    pool = {c.effect for c in confusion.candidates(())}
    assert pool == {name for name, h in hidden_tables.HIDDEN.items() if h.listed}


def test_the_independent_simulator_has_converged_in_its_step():
    excitation = hidden_tables.excitations(1, 0.2)["learn_ladder"]
    table, rng = hidden_tables.declared_truth(1), np.random.default_rng(0)
    usual = hidden_tables.record(table, excitation, 0.0, rng)["acceleration"]
    finer = hidden_tables.record(table, excitation, 0.0, rng, substeps=160)["acceleration"]
    assert np.std(usual - finer) < 2e-3 * np.std(finer)


def test_friction_on_the_hidden_valves_spool_holds_it_until_the_command_is_strong_enough():
    table = hidden_tables.declared_truth(1)._replace(spool_hysteresis=0.03)
    y = np.zeros(hidden_tables.STATES)
    y[hidden_tables.PA] = y[hidden_tables.PB] = y[hidden_tables.PS] = 1e7
    stages, work = np.zeros((4, hidden_tables.STATES)), np.zeros(hidden_tables.STATES)
    places = []
    for command in (0.03, 0.06):
        for _ in range(400):
            hidden_tables.step(table, y, 0.0, 2.5e-5, command, stages, work)
        places.append(y[hidden_tables.S])
    assert places[0] == 0.0
    assert 0.06 - 0.031 <= places[1] <= 0.06 + 0.031
