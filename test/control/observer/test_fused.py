"""What each sensor tells an observer that takes all, and what it does when one is lost, frozen, wild or biased."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from shake_ros.control.observer import OBSERVERS, fused, linear
from shake_ros.control.observer.fused import FusedObserver
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.simulation import run
from shake_ros.settings import load_table, load_variant

DT, SAMPLES = 1e-3, 3000
Array = NDArray[np.float64]
PARAMETERS = load_variant("observer", "fused", OBSERVERS)[1]
ACCELEROMETER, PRESSURES = (0,), (1, 2)


class Recording(NamedTuple):
    """Commands (n,), measured positions (n,), other sensors (n, 3), and the true motion (n, 3)."""

    commands: Array
    positions: Array
    others: Array
    motion: Array


def named(effects: dict[str, float]) -> dict[str, float]:
    """Parameters of effects by dotted name."""
    return {f"effects.{name.replace('__', '.')}": value for name, value in effects.items()}


def recording(**effects: float) -> Recording:
    """A table whose oil is softer and whose friction is higher than declared, under two sines, with sensor noise."""
    given = {"friction.coulomb_level": 700.0, "bulk_modulus.modulus": 8e8}
    table = load_table("bergamo").with_values(given | named(effects))
    t = np.arange(SAMPLES) * DT
    commands = 0.25 * np.sin(4.0 * np.pi * t) + 0.1 * np.sin(10.0 * np.pi * t)
    still = table.with_values({"effects.accelerometer_bias.bias": 0.0, "effects.accelerometer_lag.time_constant": 0.0})
    shown, true = run(table, commands, DT), run(still, commands, DT)
    rng = np.random.default_rng(4)
    others = shown[:, 2:5] + rng.standard_normal((SAMPLES, 3)) * (0.05, 2e4, 2e4)
    return Recording(commands, shown[:, 0] + 8e-6 * rng.standard_normal(SAMPLES), others, true[:, :3])


KNOWN = recording()


def estimates(r: Recording, sensors: tuple[int, ...], **model: float) -> Array:
    """With some of the sensors, by the declared model."""
    table = load_table("bergamo").with_values(named(model))
    others = np.full((SAMPLES, 3), np.nan)
    others[:, sensors] = r.others[:, sensors]
    return Observer("fused", PARAMETERS, DT, table).run(r.positions, r.commands, others)


def error(r: Recording, found: Array, first: int = 1000, last: int = SAMPLES) -> Array:
    """(3,) rms error over the true motion's rms [-]."""
    away = np.sqrt(np.mean((found[first:last] - r.motion[first:last]) ** 2, axis=0))
    return np.asarray(away / np.std(r.motion, axis=0))


def test_accelerometer_tells_velocity_and_acceleration_that_a_wrong_model_misses() -> None:
    alone, reported = error(KNOWN, estimates(KNOWN, ())), error(KNOWN, estimates(KNOWN, ACCELEROMETER))
    assert alone[2] > 0.1
    assert reported[1] < 0.5 * alone[1]
    assert reported[2] < 0.04


def test_position_alone_does_as_well_as_the_observer_that_takes_nothing_else() -> None:
    kind, parameters = load_variant("observer", "model", OBSERVERS)
    other = Observer(kind, parameters, DT, load_table("bergamo")).run(KNOWN.positions, KNOWN.commands)
    assert np.all(error(KNOWN, estimates(KNOWN, ())) < 1.1 * error(KNOWN, other))


def test_force_that_the_model_lacks_is_distinguished_from_the_pressures_by_the_accelerometer() -> None:
    pushed = recording(constant_force__force=3000.0)
    mass = load_table("bergamo").moved_mass
    others = Observer("fused", PARAMETERS.replace(force_memory=1e3), DT, load_table("bergamo"))
    state = others.initial_state(float(pushed.positions[0]))
    for k in range(SAMPLES):
        held = float(pushed.commands[k - 1]) if k else 0.0
        state, _ = others.step(state, float(pushed.positions[k]), held, pushed.others[k])
    assert math.isclose(state[len(state) - fused.SIZE + 1], 3000.0 / mass, rel_tol=0.2)


def test_bias_of_the_accelerometer_is_found_behind_its_lag() -> None:
    biased = recording(accelerometer_bias__bias=0.3, accelerometer_lag__time_constant=0.003)
    found = estimates(biased, ACCELEROMETER, accelerometer_lag__time_constant=0.003)
    blind = estimates(biased, ACCELEROMETER)
    assert error(biased, found, 1500)[2] < 0.09
    assert error(biased, found, 1500)[2] < 0.7 * error(biased, blind, 1500)[2]


@pytest.mark.parametrize("what", ["lost", "frozen", "wild"])
def test_sensor_that_fails_in_a_run_leaves_the_estimate_of_the_others_and_is_taken_again(what: str) -> None:
    others = KNOWN.others.copy()
    broken = {
        "lost": np.full(1000, np.nan),
        "frozen": np.full(1000, others[1500, 0]),
        "wild": 30.0 * np.random.default_rng(0).standard_normal(1000),
    }
    others[1000:2000, 0] = broken[what]
    others[:, PRESSURES] = np.nan
    found = estimates(KNOWN._replace(others=others), ACCELEROMETER)
    alone = error(KNOWN, estimates(KNOWN, ()), 1300, 2000)
    assert np.all(error(KNOWN, found, 1300, 2000) < 1.3 * alone)
    assert error(KNOWN, found, 2300)[2] < 0.04


def test_sensor_that_is_frozen_is_named() -> None:
    observer = Observer("fused", PARAMETERS, DT, load_table("bergamo"))
    state = observer.initial_state(0.0)
    for k in range(80):
        state, _ = observer.step(state, 0.0, 0.0, (0.1, 1e7 + k, 1e7 - k))
    assert observer.parameters.not_believed(state) == ("acceleration",)


def test_covariance_comes_to_that_of_the_riccati_equation_with_every_sensor() -> None:
    assert isinstance(PARAMETERS, FusedObserver)
    own = PARAMETERS.replace(force_memory=0.2, bias_memory=0.2)
    observer = Observer("fused", own, DT, load_table("bergamo"))
    state = observer.initial_state(0.0)
    rng = np.random.default_rng(1)
    table = run(load_table("bergamo"), np.zeros(1), DT)[0]
    for _ in range(2500):
        noise = rng.standard_normal(3) * (0.05, 2e4, 2e4)
        state, _ = observer.step(state, 8e-6 * rng.standard_normal(), 0.0, (noise[0], *(table[3:5] + noise[1:])))
    begin = len(state) - fused.SIZE + 4
    found = state[begin : begin + 49].reshape(7, 7)[:6, :6]
    step = np.zeros((6, 6))  # without a lag, l is z_3
    plain = linear.extended_transition(own, DT)
    step[:4, :4] = plain
    step[:3, 4] = -own.beta2 * plain[:3, 3]
    step[4, 4] = step[5, 5] = 1.0 - DT / 0.2
    unrest = np.diag([0.0, 0.0, own.jerk_noise**2, own.disturbance_noise**2, own.force_noise**2, own.bias_noise**2])
    unrest[2, 2] += own.force_noise**2
    unrest[2, 4] = unrest[4, 2] = own.force_noise**2
    shown = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 1.0], [0, 0, 1.0, 0, -1.0, 0]])
    mass, body = load_table("bergamo").moved_mass, load_table("bergamo").body
    pressure = 2e4 * math.sqrt(1.0 + body.area_ratio**2) * body.piston_area / mass
    noise = np.diag(np.square([own.position_noise, own.acceleration_noise, pressure]))
    scale = np.diag([1e-5, 1e-3, 1e-1, 1e1, 1e-1, 1e-1])
    back = np.linalg.inv(scale)
    before = scale @ solve_discrete_are(
        (back @ step @ scale).T, (shown @ scale).T, back @ unrest @ back * DT, noise
    ) @ scale  # fmt: skip
    gain = before @ shown.T @ np.linalg.inv(shown @ before @ shown.T + noise)
    np.testing.assert_allclose(found, before - gain @ shown @ before, rtol=1e-3, atol=1e-9)
