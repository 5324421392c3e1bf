"""simulate: every kind of table under an array, and the closed loop behind a reference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import shake_ros as sr
from shake_ros.control.closed_loop import ClosedLoop, Loop, simulate
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table, load_variant

TIME = np.arange(1500) / 1000
SINE = 0.1 * np.sin(2.0 * np.pi * 3.0 * TIME)
REFERENCE = 0.005 * np.column_stack([1.0 - np.cos(6.0 * TIME), 6.0 * np.sin(6.0 * TIME), 36.0 * np.cos(6.0 * TIME)])
REDUCED = "dynamics: {beta1: -4000.0, beta2: -40.0, beta3: 4000.0, beta4: 0.0, beta5: 0.0}\n"
AXIS = "axis: {mass: 100.0, viscous: 50.0, coulomb: 0.0, offset: 0.0}\n"


def test_full_table_runs_as_the_plant_does() -> None:
    found = sr.simulate("bergamo", SINE)
    np.testing.assert_array_equal(found.recording.truth, run(load_table("bergamo"), SINE, 1e-3)[:, :3])
    assert found.pressures is not None
    assert found.pressures.shape == (len(SINE), 3)


def test_model_gives_its_table() -> None:
    heavy = sr.simulate(sr.model(set={"specimen_mass": 500.0}), SINE)
    assert np.ptp(heavy.acceleration) != np.ptp(sr.simulate("bergamo", SINE).acceleration)


def test_reduced_table_settles_at_its_gain(tmp_path: Path) -> None:
    (tmp_path / "reduced.yaml").write_text(REDUCED, encoding="utf-8")
    found = sr.simulate(tmp_path / "reduced.yaml", np.full(1500, 0.2))
    assert found.velocity[-1] == pytest.approx(0.2, rel=1e-3)  # β_3/−β_1 = 1 m/s per command
    assert found.pressures is None


def test_axis_under_a_constant_force_approaches_its_terminal_velocity(tmp_path: Path) -> None:
    (tmp_path / "axis.yaml").write_text(AXIS, encoding="utf-8")
    found = sr.simulate(tmp_path / "axis.yaml", np.full(20000, 10.0))
    decay = 1.0 - np.exp(-50.0 / 100.0 * found.time)  # M v̇ = F − F_v v from rest
    np.testing.assert_allclose(found.velocity, 10.0 / 50.0 * decay, atol=1e-9)
    assert found.command[0] == 10.0


def test_closed_loop_is_the_compiled_one() -> None:
    found = sr.simulate("bergamo", REFERENCE, controller="feedforward_pi", observer=None, seed=3, delay=1)
    law = Controller(*load_variant("controller", "feedforward_pi", CONTROLLERS), 1e-3)
    expected: ClosedLoop = simulate(Loop(load_table("bergamo"), None, law, REFERENCE, seed=3, delay=1))[0]
    np.testing.assert_array_equal(found.recording.truth, expected.truth)
    np.testing.assert_array_equal(found.command, expected.command)
    assert found.error["motion"] == ("position", "velocity", "acceleration")


def test_closed_loop_needs_a_full_table(tmp_path: Path) -> None:
    (tmp_path / "axis.yaml").write_text(AXIS, encoding="utf-8")
    with pytest.raises(ShakeError, match="not one of the model axis"):
        sr.simulate(tmp_path / "axis.yaml", REFERENCE)


def test_run_reads_back_as_it_was_written(tmp_path: Path) -> None:
    found = sr.simulate("bergamo", SINE)
    (again,) = sr.read(found.write(tmp_path / "bag"))
    np.testing.assert_allclose(again.position, found.recording.position, atol=1e-15)
    np.testing.assert_array_equal(again.valve_command, SINE)


def test_run_goes_into_the_other_verbs() -> None:
    found = sr.simulate("bergamo", SINE)
    assert found.thd(frequency=3.0, start=0.5).thd > 0.0
    assert found.spectrum(periods=[0.2]).acceleration[0] > np.abs(found.acceleration).max()
    assert sr.frequency_response(found, window=0.5, at=[4.0]).rows[0][1] > 0.0
    assert len(found.plot().axes) == 3


@pytest.mark.parametrize(
    ("table", "command", "reason"),
    [("bergam", SINE, "did you mean 'bergamo'"), ("bergamo", [0.0, np.nan], "nan"), ("bergamo", "sin", "unknown ref")],
)
def test_wrong_arguments_are_one_clear_line(table: str, command: object, reason: str) -> None:
    with pytest.raises(ShakeError, match=reason):
        sr.simulate(table, command)  # type: ignore[arg-type]
