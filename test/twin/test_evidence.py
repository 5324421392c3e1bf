"""What windows say of the parameters, of the noise, and of the scale of all forces, which no motion shows."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

import shake_ros as sr
from benchmarks.discovery import hidden_tables as hidden
from benchmarks.twin import release
from shake_ros.fit.likelihood import Levels
from shake_ros.fit.model import FreeModel, start_of
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.records import Record
from shake_ros.fit.segment import Segment
from shake_ros.fit.solver import prior_residuals
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.settings import load_table
from shake_ros.twin.evidence import (
    FORCES,
    HELD,
    MASS,
    MOVED_MASS,
    QUIET,
    KnownState,
    ScaledPredictor,
    noise_levels,
    scale_free,
    segment_of,
)
from shake_ros.twin.followed import followed, load_twin
from shake_ros.twin.naming import KnownModel
from shake_ros.twin.twin import Twin

TRUTH = hidden.declared_truth(71)
TABLE = load_table("bergamo").with_values({name: getattr(TRUTH, field) for name, field in hidden.DECLARED.items()})
OTHERS = ("supply.tank_pressure", "bulk_modulus.reference_pressure", "valve.laminar_pressure")


def segment() -> Segment:
    rng = np.random.default_rng(1)
    made = hidden.record(TRUTH, hidden.multisine(1.5, 1, 0.5, 8.0, 0.2, rng), 1.0, rng, 20)
    return Segment.of(Record("run", hidden.SAMPLE, made["command"], made["position"], made["acceleration"]))


def larger(vector: np.ndarray, factor: float) -> np.ndarray:
    """The same table with all its forces larger."""
    found = vector.copy()
    for name, power in (FORCES | dict.fromkeys(OTHERS, 1.0)).items():
        found[FULL_LAYOUT.index[name]] *= factor**power
    found[FULL_LAYOUT.index[MASS]] += (factor - 1.0) * np.sum(vector[MOVED_MASS])
    return found


def test_innovations_stay_the_same_where_all_forces_grow_together() -> None:
    vector = start_of(TABLE, []).vectors(np.zeros(0))[0]
    rows = np.array([vector, larger(vector, 1.2)])
    levels = Levels(force=0.05, memory=0.03, **HELD)
    own, scaled = ScaledPredictor([segment()], levels).filtered(vector).residuals(rows)
    assert scaled == pytest.approx(own, abs=1e-2)
    plain, moved = Predictor([segment()], levels).filtered(vector).residuals(rows)
    assert np.max(np.abs(moved - plain)) > 0.1


def test_what_is_known_together_of_the_parameters_is_their_prior() -> None:
    model, covariance = followed(TABLE, load_twin()).model, np.array([[1.0, 0.9], [0.9, 1.0]])
    two = replace(model, free=model.free[:2], x=model.x[:2])
    given = {f.name: getattr(two, f.name) for f in fields(FreeModel)}
    known = KnownModel(**given, known=KnownState(two.x, covariance))
    moved = np.array([0.3, -0.2])
    left = prior_residuals(known, two.x + moved)
    assert left @ left == pytest.approx(moved @ np.linalg.solve(covariance, moved))
    freed = KnownModel(**given | {"priors": {two.names[0]: (0.0, np.inf)}}, known=known.known)
    left = prior_residuals(freed, two.x + moved)
    assert left @ left == pytest.approx(moved[1] ** 2)


def test_the_short_memory_of_a_random_force_is_found_beside_the_noise_of_the_sensor() -> None:
    rng = np.random.default_rng(3)
    shaken = TRUTH._replace(rumble=0.01 * (TRUTH.supply - TRUTH.tank) * TRUTH.area)
    made = hidden.record(shaken, hidden.multisine(2.0, 1, 0.5, 8.0, 0.2, rng), 1.0, rng, 20)
    record = Record("run", hidden.SAMPLE, made["command"], made["position"], made["acceleration"])
    begin = Levels(force=0.05, memory=0.1, acceleration=0.5 / QUIET, **HELD)
    found = noise_levels([segment_of(record)], start_of(TABLE, []), begin)
    assert 0.4 < found.memory * shaken.rumble_rate < 2.5
    own = QUIET * found.acceleration * Segment.of(record).noise[1]
    assert own == pytest.approx(hidden.ACCELERATION_NOISE, rel=0.6)


def test_a_controller_that_feeds_noise_back_does_not_bias_the_reference() -> None:
    names, table = next(iter(release.LOOPS.values())), load_table("bergamo")
    twin = Twin(table, load_twin(), release.DT)
    for k in range(release.SOUND):
        observer, controller = release.loop(names, table, table)
        run = sr.simulate(
            table, release.motion(k), release.DT, controller=controller, observer=observer, seed=k
        ).recording
        stamps = np.rint((1.0 + 20.0 * k + run.time) * 1e9).astype(np.int64)
        assert run.acceleration is not None
        twin.begin(str(k))
        windows = [*twin.add(stamps, run.valve_command, run.position, run.acceleration)]
    assert twin.error < 0.05
    low, high = windows[-1].ends
    file = np.array([twin.file_value(name) for name in twin.names])
    assert np.mean((low < file) & (file < high)) > 0.85


def test_a_jacobian_shows_nothing_of_the_scale_of_forces() -> None:
    model = followed(TABLE, load_twin()).model
    shown = scale_free(np.random.default_rng(2).normal(size=(50, len(model.x))), model, model.x)
    way = model.x * [FORCES.get(n, 0.0) for n in model.names]
    way[model.names.index(MASS)] = TABLE.moved_mass / model.scale[model.names.index(MASS)]
    assert shown @ way == pytest.approx(np.zeros(50), abs=1e-9)
