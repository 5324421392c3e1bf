"""Drive-file iteration with a model that each run corrects, on the simulated table."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.control.closed_loop import Loop, simulate
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.records import Record
from shake_ros.iteration.drive import Iteration, iterate_model, refit, starts
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.settings import find, load_table, load_variant, read_yaml

DT = 0.001
DECLARED = load_table("bergamo")
TRUTH = DECLARED.with_values({"effects.soft_zone.depth": 0.8})
SOFT_ZONE = [c for c in effect_candidates() if c.effect == "soft_zone"]


def motion() -> np.ndarray:
    """2.5 s of two sines under a smooth envelope, (n, 3)."""
    time = np.arange(2500) * DT
    envelope = np.sin(np.pi * time / time[-1]) ** 2
    position = envelope * (0.02 * np.sin(2.0 * np.pi * 1.7 * time) + 0.002 * np.sin(2.0 * np.pi * 6.1 * time))
    velocity = np.gradient(position, DT)
    return np.column_stack([position, velocity, np.gradient(velocity, DT)])


REFERENCE = motion()


def play(model: TableParameters, number: int) -> Record:
    """A run on the true table under the feedforward and the observer of a model."""
    observer = Observer(*load_variant("observer", "model_soft_zone", OBSERVERS), DT, model)
    law = Controller(*load_variant("controller", "super_twisting_model", CONTROLLERS), DT, model)
    run, finite = simulate(Loop(TRUTH, observer, law, REFERENCE, seed=number))
    assert finite == len(REFERENCE)
    return Record(f"run {number}", DT, run.command, run.measured[:, 0], run.measured[:, 1])


def settings(runs: int) -> Iteration:
    path = find("iteration", "default")
    return Iteration.from_mapping(read_yaml(path), str(path)).replace(good_enough=0.0, runs=runs)


def test_one_run_is_enough_where_the_model_can_become_the_table() -> None:
    free = [p for p in free_parameters() if p.name in ("bulk_modulus.modulus", "valve.flow_coefficient")]
    first = DECLARED.with_values({"valve.flow_coefficient": 1.2 * DECLARED.value("valve.flow_coefficient")})
    models, errors, reason = iterate_model(
        REFERENCE[:, 2], first, play, lambda model, records: refit(model, free, SOFT_ZONE, records), settings(2)
    )
    assert reason == "most runs"
    assert errors[0] > 0.3
    assert errors[1] < 0.06
    found = models[1]
    assert found.value("effects.soft_zone.depth") == pytest.approx(0.8, abs=0.03)
    assert found.value("valve.flow_coefficient") == pytest.approx(TRUTH.value("valve.flow_coefficient"), rel=0.01)


def test_an_effect_that_is_absent_starts_from_its_trials_and_one_that_is_there_from_itself() -> None:
    moved = SOFT_ZONE[0].free
    absent = starts(FreeParameters(DECLARED, moved), SOFT_ZONE)
    present = starts(FreeParameters(TRUTH, moved), SOFT_ZONE)
    assert len(absent) == 1 + len(SOFT_ZONE[0].trials)
    assert len(present) == 1
    assert present[0, 0] * moved[0].scale == pytest.approx(0.8)


def test_recordings_without_acceleration_are_refused() -> None:
    silent = Record("run", DT, np.zeros(2500), REFERENCE[:, 0])
    with pytest.raises(ShakeError, match="with acceleration"):
        refit(DECLARED, free_parameters(), SOFT_ZONE, [silent])
    with pytest.raises(ShakeError, match="needs the acceleration"):
        iterate_model(REFERENCE[:, 2], DECLARED, lambda *_: silent, lambda model, _: model, settings(2))
