"""The sliding-mode observer on the whole table: its stages, its gate and what it converges to."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from shake_ros.control.closed_loop import normalised_error
from shake_ros.control.observer import OBSERVERS, linear
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.physics.plant.states import POSITION, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.settings import load_table, load_variant

DT = 0.001
Array = NDArray[np.float64]
QUIET = {"sensors.position_noise": 0.0, "sensors.position_bits": 0}
SIGNS = {f"boundary{i}": 0.0 for i in range(1, 5)}


@pytest.fixture(scope="module")
def soft() -> TableParameters:
    return load_table("bergamo").with_values({"effects.soft_zone.depth": 0.84, **QUIET})


def observer(model: TableParameters, name: str = "model_sliding_mode", **changes: float) -> Observer:
    kind, parameters = load_variant("observer", name, OBSERVERS)
    return Observer(kind, parameters.replace(**changes), DT, model)


def moved(table: TableParameters, samples: int) -> tuple[Array, Array]:
    """Commands, and position, velocity, acceleration of the table under them."""
    t = np.arange(samples) * DT
    commands = 0.3 * np.sin(2.0 * np.pi * 2.0 * t)
    return commands, run(table, commands, DT)[:, :3]


def corrections(table: TableParameters, innovation: float, **changes: float) -> Array:
    """Change of position, velocity and, by the load pressure, acceleration that an innovation makes at rest."""
    states = []
    for position in (0.0, innovation):
        one = observer(table, **changes)
        states.append(one.step(one.initial_state(0.0), position, 0.0)[0])
    change = states[1] - states[0]
    force = table.body.piston_area * (change[PRESSURE_A] - change[PRESSURE_B])
    return np.array([change[POSITION], change[VELOCITY], force / table.moved_mass])


def test_stage_is_fed_only_once_the_one_before_has_reached_its_surface(soft: TableParameters) -> None:
    gains = {**SIGNS, "lambda1": 0.03, "lambda2": 2.5, "lambda3": 5.0, "lambda4": 0.0}
    far = corrections(soft, 1e-3, **gains)  # beyond dt λ_1 = 30 µm: position alone
    np.testing.assert_allclose(far, [3e-5, 0.0, 0.0], atol=1e-12)
    near = corrections(soft, 1e-5, **gains)  # first surface reached, second saturated
    np.testing.assert_allclose(near, [1e-5, 2.5e-3, 0.0], atol=1e-12)
    nearest = corrections(soft, 2e-6, **gains)  # 2 mm/s within dt λ_2: the load pressure is fed, by dt λ_3
    np.testing.assert_allclose(nearest, [2e-6, 2e-3, 5.0 * DT], rtol=1e-6)


def test_signs_without_layers_find_the_motion_of_their_own_model(soft: TableParameters) -> None:
    commands, motion = moved(soft, 1500)
    late = slice(300, None)  # starts at rest amid the motion
    signs = {**SIGNS, "lambda4": 0.0}
    found = observer(soft, **signs).run(motion[late, 0], commands[late])[700:]
    assert np.all(np.abs(found - motion[late][700:]).max(axis=0) < [1e-6, 1e-3, 2e-2])


def test_within_the_layers_it_has_the_gain_that_they_were_made_from(soft: TableParameters) -> None:
    # as its configuration says: half the β of the table, 0.3 m/s^2.5 and 60 m/s^3.5
    _, p = load_variant("observer", "linear_bergamo", OBSERVERS)
    half = p.replace(**{f"beta{i}": 0.5 * getattr(p, f"beta{i}") for i in range(1, 6)})
    gain = linear.kalman_gain(half.replace(jerk_noise=0.3, disturbance_noise=60.0), DT)
    innovation = 1e-6
    np.testing.assert_allclose(corrections(soft, innovation), gain[:3] * innovation, rtol=2e-3)
    one = observer(soft)
    disturbance = one.step(one.initial_state(0.0), innovation, 0.0)[0][-1]
    assert disturbance * half.beta3 == pytest.approx(gain[3] * innovation, rel=2e-3)


def test_null_shift_that_the_model_lacks_leaves_no_error(soft: TableParameters) -> None:
    shifted = soft.with_values({"effects.valve_null_shift.offset": 0.02})
    commands, motion = moved(shifted, 2500)
    errors = []
    for changes in ({}, {"lambda4": 0.0}):
        found = observer(soft, **changes).run(motion[:, 0], commands)
        errors.append(np.sqrt(np.mean((found - motion)[1500:, 1] ** 2)))
    assert errors[0] < 2e-4
    assert errors[0] < 0.1 * errors[1]


@pytest.mark.parametrize("load", [0.0, 200.0, 500.0])
@pytest.mark.parametrize("name", ["model_soft_zone", "model_sliding_mode"])
def test_velocity_within_2_and_acceleration_within_15_percent_with_the_identified_model(
    soft: TableParameters, name: str, load: float
) -> None:
    # thesis's soft zone, a sample of delay, 8 µm of noise in 4.6 µm steps, a motion of several hertz
    table = soft.with_values({"body.specimen_mass": load, "effects.command_delay.delay": DT})
    t = np.arange(3000) * DT
    commands = 0.2 * np.sin(9.0 * t) + 0.1 * np.sin(23.0 * t) + 0.05 * np.sin(41.0 * t)
    motion = run(table, commands, DT)[:, :3]
    step = 0.3 / 2**16
    measured = np.round((motion[:, 0] + 8e-6 * np.random.RandomState(5).standard_normal(t.size)) / step) * step
    error = normalised_error(motion[500:], observer(table, name).run(measured, commands)[500:])
    assert error[1] < 0.02
    assert error[2] < 0.15
