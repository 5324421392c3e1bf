"""The load that is followed is the specimen that stands on the table, from command, position and accelerometer."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.control.observer.load import LEAST, LoadTracker, LoadTracking
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import ShakeError
from shake_ros.settings import find, load_table, read_yaml

DT, SECONDS = 1e-3, 5.0
KNOWN = load_table("bergamo").with_values({"bulk_modulus.modulus": 5.8e8})  # 200 kg
TRACKER = LoadTracker(LoadTracking.from_mapping(read_yaml(find("load", "default")), "default"), KNOWN, DT)


def recording(table: TableParameters) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Noisy position and accelerometer of a table under a sum of sines from 0.7 to 9 Hz, and the command."""
    t = np.arange(round(SECONDS / DT)) * DT
    command = sum(0.09 * np.sin(2.0 * np.pi * f * t + f * f) for f in (0.7, 1.9, 3.7, 5.3, 6.7, 9.1))
    out = run(table, command * np.minimum(t, 1.0), DT)
    rng = np.random.default_rng(2)
    position = out[:, 0] + 8e-6 * rng.standard_normal(len(t))
    return position, out[:, 2] + 0.05 * rng.standard_normal(len(t)), command * np.minimum(t, 1.0)


@pytest.mark.parametrize("mass", [0.0, 500.0])
def test_rigid_mass_is_found(mass: float) -> None:
    reported, errors = TRACKER.run(*recording(KNOWN.with_values({"body.specimen_mass": mass})))
    rigid, swaying, _ = reported[-1]
    assert math.isclose(rigid + swaying, mass, abs_tol=40.0)
    assert errors[0] < 150.0


def test_mass_that_sways_is_found_with_its_frequency() -> None:
    own = {"mass": 150.0, "frequency": 6.0, "damping": 0.03}
    swaying = KNOWN.with_values({f"effects.specimen_resonance.{name}": value for name, value in own.items()})
    reported, errors = TRACKER.run(*recording(swaying))
    assert math.isclose(reported[-1, 1], 150.0, rel_tol=0.2)
    assert math.isclose(reported[-1, 2], 6.0, rel_tol=0.03)
    assert errors[2] < 0.5


def test_table_at_rest_tells_nothing_and_nothing_changes() -> None:
    rng = np.random.default_rng(1)
    n = 3000
    reported, errors = TRACKER.run(8e-6 * rng.standard_normal(n), 0.05 * rng.standard_normal(n), np.zeros(n))
    np.testing.assert_allclose(reported[-1, :2], [200.0, LEAST], atol=5.0)
    assert errors[0] == pytest.approx(300.0, rel=0.05)


def test_series_that_do_not_belong_together_are_refused() -> None:
    with pytest.raises(ShakeError, match="shapes"):
        TRACKER.run(np.zeros(3), np.zeros(4), np.zeros(3))
    with pytest.raises(ShakeError, match="not finite"):
        TRACKER.run(np.zeros(3), np.array([0.0, math.nan, 0.0]), np.zeros(3))
