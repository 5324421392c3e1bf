"""The force that a model lacks, on tables of another simulator whose force is known."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from benchmarks.discovery import hidden_tables as hidden
from benchmarks.discovery.latent_force import declared_table, relative_error, true_force
from shake_ros.explain.latent_force import LatentForce, latent_force
from shake_ros.fit.axis_model import AXIS
from shake_ros.fit.declared_model import FULL
from shake_ros.fit.nuisances.explained_band import limited
from shake_ros.fit.records import Record
from shake_ros.fit.reduced_model import REDUCED
from shake_ros.physics.plant.axis import AXIS_LAYOUT, AxisParameters
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import REDUCED_LAYOUT, ReducedParameters
from shake_ros.settings import load_search

SETTINGS = load_search()
SEED = 3


@functools.cache
def found(which: str = "hold_multisine", seed: int = SEED, **effects: float) -> tuple[LatentForce, np.ndarray]:
    """The force that the table without the effects lacks beside one that has them, and the true one [N]."""
    base = hidden.declared_truth(seed)
    truth = base._replace(**effects)
    made = hidden.record(truth, hidden.excitations(seed)[which], 1.0, np.random.default_rng(seed))
    record = Record(which, hidden.SAMPLE, made["command"], made["position"], made["acceleration"])
    force = latent_force(FULL, declared_table(base), record, SETTINGS)
    assert force is not None
    return force, true_force(truth, record)


def test_no_force_is_estimated_for_a_table_that_shakes_by_itself() -> None:
    noise = 1e-3 * np.random.default_rng(1).standard_normal((2, 2000))
    (shaken,) = limited([Record("shaken", hidden.SAMPLE, np.zeros(2000), *noise)], 20.0)
    assert latent_force(FULL, declared_table(hidden.declared_truth(SEED)), shaken, SETTINGS) is None


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("which", ["hold_multisine", "hold_pulses"])
def test_force_of_a_table_that_lacks_nothing_is_zero_within_its_band(which: str, seed: int) -> None:
    force, _ = found(which, seed)
    assert force.kinds.zero
    assert force.kinds.outside < 0.1
    assert force.of_inertia < 0.02


@pytest.mark.parametrize("which", ["hold_multisine", "hold_pulses"])
def test_spring_to_ground_is_found_as_a_force_of_position(which: str) -> None:
    force, true = found(which, stiffness_to_ground=3e5)
    assert relative_error(force, true) < 0.12
    assert next(iter(force.kinds.depends_on)) == "position"
    assert force.left[1] < 0.1 * force.left[0]


@pytest.mark.parametrize("which", ["hold_multisine", "hold_pulses"])
def test_push_at_one_place_is_found_as_a_force_of_position(which: str) -> None:
    force, true = found(which, force_bump=1500.0)
    assert relative_error(force, true) < 0.12
    assert next(iter(force.kinds.depends_on)) == "position"
    low, high = force.ends
    assert float(np.mean((low < true) & (true < high))) > 0.9


def test_pulses_that_nothing_in_the_motion_tells_of_are_few_short_events() -> None:
    force, true = found(pulse_force=800.0)
    assert relative_error(force, true) < 0.2
    assert "impulsive" in force.kinds.kinds
    assert force.kinds.depends_on == {}
    assert force.peak == pytest.approx(800.0, rel=0.1)


def test_friction_that_builds_up_over_a_displacement_acts_at_reversals() -> None:
    force, _ = found(presliding_friction=3e-4)
    assert "at reversals" in force.kinds.kinds


def test_specimen_whose_spring_hardens_is_a_line_of_its_own() -> None:
    force, _ = found(cubic_specimen=60.0)
    assert force.kinds.kinds == ("line",)
    assert 4.0 < force.kinds.line < 8.0


def test_pulsating_supply_shows_as_a_force_under_which_the_run_is_at_its_noise() -> None:
    force, _ = found(supply_pulsation=0.1)
    assert force.left[0] > 5.0
    assert force.left[1] < 1.1


def test_constant_force_is_found_though_it_moves_nothing_for_long() -> None:
    force, true = found(constant_force=500.0)
    assert force.kinds.kinds == ("constant",)
    assert relative_error(force, true) < 0.1


def driven_axis(push: np.ndarray, fine: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force, position and acceleration at 1 kHz of 10 kg with 20 N s/m and 5 N of dry friction, in steps of Euler."""
    dt, n = 1e-3 / fine, len(push)
    time = np.arange(n) * 1e-3
    drive = 100.0 * np.sin(9.0 * time) + 50.0 * np.sin(31.0 * time)
    x = v = a = 0.0
    out = np.empty((n, 2))
    for k in range(n):
        out[k] = x, a
        for _ in range(fine):
            a = (drive[k] + push[k] - 20.0 * v - 5.0 * np.tanh(v / 1e-4)) / 10.0
            v += dt * a
            x += dt * v
    return drive, out[:, 0], out[:, 1]


def test_axis_is_told_the_force_that_it_was_pushed_with() -> None:
    time = np.arange(3000) * 1e-3
    push = np.where((time > 1.2) & (time < 1.5), 12.0 * np.sin(np.pi * (time - 1.2) / 0.3) ** 2, 0.0)
    drive, x, a = driven_axis(push, 20)
    rng = np.random.default_rng(0)
    x, a = x + 1e-5 * rng.standard_normal(3000), a + 0.05 * rng.standard_normal(3000)
    parameters = AxisParameters(mass=10.0, viscous=20.0, coulomb=5.0, offset=0.0)
    table = TableParameters(AXIS_LAYOUT, {"axis": parameters})
    force = latent_force(AXIS, table, Record("axis", 1e-3, drive, x, a), SETTINGS)
    assert force is not None
    assert force.unit == "N"
    assert relative_error(force, push[-len(force.force) :]) < 0.1
    assert "impulsive" in force.kinds.kinds
    without = latent_force(AXIS, table, Record("axis", 1e-3, drive, x), SETTINGS)
    assert without is not None
    assert without.of_inertia == pytest.approx(force.of_inertia, rel=0.15)
    assert relative_error(without, push[-len(force.force) :]) < 0.1


def test_reduced_model_counts_the_force_per_mass() -> None:
    beta = ReducedParameters(beta1=-2500.0, beta2=-12.0, beta3=1250.0, beta4=-20.0, beta5=0.0)
    time, fine = np.arange(4000) * 1e-3, 20
    u = 0.3 * np.sin(12.0 * time) + 0.15 * np.sin(31.0 * time)
    push = 0.6 * np.sin(2.0 * np.pi * 7.7 * time)
    x = v = w = 0.0
    out = np.empty((4000, 2))
    for k in range(4000):
        for step in range(fine):
            if step == 0:
                out[k] = x, w + push[k]
            v += 1e-3 / fine * (w + push[k])
            w += 1e-3 / fine * (-2500.0 * v - (12.0 + 20.0 * abs(u[k])) * w + 1250.0 * u[k])
            x += 1e-3 / fine * v
    rng = np.random.default_rng(0)
    record = Record(
        "reduced", 1e-3, u, out[:, 0] + 1e-5 * rng.standard_normal(4000), out[:, 1] + 0.03 * rng.standard_normal(4000)
    )
    force = latent_force(REDUCED, TableParameters(REDUCED_LAYOUT, {"dynamics": beta}), record, SETTINGS)
    assert force is not None
    assert force.unit == "m/s²"
    later = slice(1000, None)  # a reduced run begins without acceleration: what rings on counts as a force at first
    assert np.std(force.force[later] - push[500:][later]) < 0.1 * np.std(push)
    assert force.left[1] < 0.1 * force.left[0]
    assert force.kinds.kinds == ("line",)
    assert force.kinds.line == pytest.approx(7.7, rel=0.13)
