"""The reduced model in a fit: first guess, recovery of parameters and effects from recordings at 200 Hz."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.reduced_model import REDUCED
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import REDUCED_LAYOUT, ReducedParameters
from shake_ros.physics.plant.reduced_simulation import run
from shake_ros.quantities import ShakeError
from shake_ros.repair.close_loop import close_loop
from shake_ros.search.problem import ModelStructure
from shake_ros.settings import load_search

DT = 0.005
BETA = ReducedParameters(beta1=-1600.0, beta2=-30.0, beta3=1000.0, beta4=-2.0, beta5=-10.0)
TRUTH = TableParameters(REDUCED_LAYOUT, {"dynamics": BETA})


def record(table: TableParameters, seed: int, acceleration: bool = False) -> Record:
    """Twelve seconds of a multi-sine command at 200 Hz with a little noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(2400) * DT
    phases = rng.uniform(0.0, 2.0 * np.pi, 12)
    command = np.sum([np.cos(2 * np.pi * 0.5 * (k + 1) * time + p) for k, p in enumerate(phases)], axis=0)
    command *= 0.5 / np.max(np.abs(command))
    out = run(table, command, DT)
    position = out[:, 0] + 1e-5 * rng.standard_normal(len(time))
    sensed = out[:, 2] + 0.01 * rng.standard_normal(len(time)) if acceleration else None
    return Record(f"run_{seed}", DT, command, position, sensed)


def quiet(text: str, part: float) -> None:
    """No progress bar."""


def test_the_first_guess_comes_near_and_needs_no_declaration() -> None:
    records = [record(TRUTH, 1)]
    guess = REDUCED.first_table(records)
    error = RecordingProblem(records, REDUCED).errors(guess.vector())["run_1"]["velocity"]
    assert error < 0.3
    assert guess.value("dynamics.beta3") / -guess.value("dynamics.beta1") == pytest.approx(1000.0 / 1600.0, rel=0.15)


def test_a_velocity_against_the_command_is_told() -> None:
    r = record(TRUTH, 1)
    with pytest.raises(ShakeError, match="run_1: the velocity goes against the command"):
        REDUCED.first_table([Record(r.name, DT, -r.commands, r.position)])


def test_a_command_of_zero_is_told() -> None:
    r = record(TRUTH, 1)
    with pytest.raises(ShakeError, match="run_1: the command is zero"):
        REDUCED.first_table([Record(r.name, DT, 0.0 * r.commands, r.position)])


@pytest.mark.parametrize(
    ("name", "value"),
    [("spool_deadband.width", 0.08), ("command_delay.delay", 0.02), ("coulomb_friction.force", 1.5)],
)
def test_a_hidden_effect_is_named_from_recordings_without_an_accelerometer(name: str, value: float) -> None:
    hidden = TRUTH.with_values({f"effects.{name}": value})
    learn, hold = [record(hidden, 1), record(hidden, 2)], [record(hidden, 3)]
    pool = tuple(c for c in effect_candidates(REDUCED) if c.effect != "specimen_resonance")
    structure = ModelStructure(
        REDUCED.first_table(learn), tuple(free_parameters(REDUCED)), candidates=pool, simulator=REDUCED
    )
    result = close_loop(structure, learn, hold, load_search(), quiet)
    step = result.search.steps[0]
    assert name.partition(".")[0] in (step.chosen.candidate.effect, *step.alternatives)
    assert result.final.validation["run_3"]["velocity"] < 0.3 * result.baseline.validation["run_3"]["velocity"]
    if step.chosen.candidate.effect == name.partition(".")[0]:
        assert result.final.table.value(f"effects.{name}") == pytest.approx(value, rel=0.1)


def test_two_effects_at_once_are_both_named() -> None:
    hidden = TRUTH.with_values({"effects.spool_deadband.width": 0.08, "effects.coulomb_friction.force": 1.5})
    learn, hold = [record(hidden, 1), record(hidden, 2)], [record(hidden, 3)]
    structure = ModelStructure(
        REDUCED.first_table(learn),
        tuple(free_parameters(REDUCED)),
        candidates=effect_candidates(REDUCED),
        simulator=REDUCED,
    )
    result = close_loop(structure, learn, hold, load_search(), quiet)
    assert {v.effect for v in result.verdicts} == {"spool_deadband", "coulomb_friction"}
    assert result.final.table.value("effects.spool_deadband.width") == pytest.approx(0.08, rel=0.05)
    assert result.final.table.value("effects.coulomb_friction.force") == pytest.approx(1.5, rel=0.05)
