"""Backlash shows in an acceleration that dwells at zero; no other effect that was tried does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.discovery import hidden_tables as hidden
from shake_ros import declared
from shake_ros.api.read import recording, recordings
from shake_ros.explain.diagnosis import diagnose
from shake_ros.fit.declared_model import FULL
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start.backlash import SHARE, share_of_dwells, width_of_gap
from shake_ros.report.page import Page
from shake_ros.report.report_json import diagnosis_json
from shake_ros.report.sections import remains_section
from shake_ros.settings import load_table


def records(effect: str, part: float, seed: int) -> list[Record]:
    """The recordings of a table that the package does not simulate, with one effect."""
    commands = hidden.excitations(seed, 0.5)
    command = commands["learn_multisine"]
    table = hidden.with_effect(hidden.declared_truth(seed), effect, part, commands, seed)
    made = hidden.record(table, command, 1.0, np.random.default_rng([seed, 7]))
    times = np.arange(len(command)) * hidden.SAMPLE
    run = recording("run", times, made["command"], made["position"], acceleration=made["acceleration"])
    return recordings(run[0]).records("valve_command")


@pytest.mark.parametrize(
    ("effect", "part", "seed", "found"),
    [
        ("coupling_backlash", 0.3, 2046, True),
        ("spool_deadband", 0.3, 2046, False),
        ("position_dependent_friction", 0.3, 2046, False),
        ("soft_zone", 0.3, 23, False),  # keeps the acceleration near zero as well, but nothing strikes
    ],
)
def test_the_acceleration_dwells_at_zero_where_the_table_has_backlash(
    effect: str, part: float, seed: int, found: bool
) -> None:
    assert (share_of_dwells(records(effect, part, seed)) > SHARE) is found


@pytest.mark.parametrize("seed", [2046, 2047])
def test_the_dwells_show_how_wide_the_gap_is(seed: int) -> None:
    base, commands = hidden.declared_truth(seed), hidden.excitations(seed, 0.5)
    gap = hidden.with_effect(base, "coupling_backlash", 0.3, commands, seed).coupling_backlash
    assert 0.5 * gap < width_of_gap(records("coupling_backlash", 0.3, seed)) < 2.0 * gap


def test_without_an_accelerometer_nothing_dwells() -> None:
    silent = [replace(r, acceleration=None) for r in records("coupling_backlash", 0.3, 2046)]
    assert share_of_dwells(silent) == width_of_gap(silent) == 0.0


@pytest.mark.parametrize(("lacks", "said"), [(True, True), (False, False)])
def test_the_report_states_it_where_the_model_has_no_backlash(lacks: bool, said: bool) -> None:
    found = records("coupling_backlash", 0.3, 2046)
    table = load_table("bergamo").with_values({} if lacks else {"effects.coupling_backlash.gap": 1e-4})
    free = FreeParameters(table, declared.free_parameters(FULL))
    fitted_once = fit(RecordingProblem(found), free, free.start(), evaluations=1)
    diagnosis = diagnose(fitted_once, found, (), ())
    page = Page("a", "b")
    remains_section(page, diagnosis)
    assert ("look for backlash" in page.text()) is said
    assert ("look for backlash" in diagnosis_json(diagnosis)["text"]) is said
