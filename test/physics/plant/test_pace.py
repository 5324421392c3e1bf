"""Runs that follow the steps of another: they are as right as with their own, and differ from it smoothly."""

from __future__ import annotations

import numpy as np

from shake_ros.physics.plant.simulation import SMOOTH, initial_state, run, run_batch
from shake_ros.settings import load_table

BERGAMO = load_table("bergamo")
SAMPLE = 1e-3
RNG = np.random.default_rng(3)
COMMANDS = np.repeat(0.25 * RNG.standard_normal(75), 40)  # 3 s
MODULUS, VALVE, MASS = "bulk_modulus.modulus", "valve.natural_frequency", "body.table_mass"


def acceleration_changes(name: str, parts: np.ndarray, tolerance: float) -> np.ndarray:
    """Accelerations with a parameter changed by parts of itself, less those without, in a batch, shape (m, n)."""
    tables = [BERGAMO, *(BERGAMO.with_values({name: BERGAMO.value(name) * (1.0 + part)}) for part in parts)]
    vectors = np.array([t.vector() for t in tables])
    starts = np.array([initial_state(v) for v in vectors])
    out = run_batch(vectors, starts, COMMANDS, SAMPLE, columns=(2,), tolerance=tolerance)[:, :, 0]
    return np.asarray(out[1:] - out[0])


def one_by_one(name: str, parts: np.ndarray, tolerance: float) -> np.ndarray:
    """The same with runs that take steps of their own."""
    tables = [BERGAMO, *(BERGAMO.with_values({name: BERGAMO.value(name) * (1.0 + part)}) for part in parts)]
    out = np.array([run(t, COMMANDS, SAMPLE, tolerance=tolerance)[:, 2] for t in tables])
    return np.asarray(out[1:] - out[0])


def relative(found: np.ndarray, true: np.ndarray) -> float:
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def test_small_changes_are_those_of_runs_of_a_far_smaller_tolerance() -> None:
    for name in (VALVE, MASS):
        parts = np.array([1e-4])
        true = one_by_one(name, parts, 1e-12)
        followed = relative(acceleration_changes(name, parts, SMOOTH), true)
        own = relative(one_by_one(name, parts, SMOOTH), true)
        assert followed < 0.03
        assert own > 3.0 * followed


def test_a_far_change_is_as_right_as_with_steps_of_its_own() -> None:
    parts = np.array([0.5])
    true = one_by_one(MODULUS, parts, 1e-10)
    assert relative(acceleration_changes(MODULUS, parts, SMOOTH), true) < 1e-3


def test_a_run_that_the_steps_do_not_suit_takes_its_own() -> None:
    fast = BERGAMO.with_values({MODULUS: 0.01 * BERGAMO.value(MODULUS)}), BERGAMO  # the first one needs few steps
    vectors = np.array([t.vector() for t in fast])
    starts = np.array([initial_state(v) for v in vectors])
    out = run_batch(vectors, starts, COMMANDS, SAMPLE, columns=(2,), tolerance=SMOOTH)[:, :, 0]
    assert relative(out[1], run(BERGAMO, COMMANDS, SAMPLE, tolerance=1e-10)[:, 2]) < 1e-3
