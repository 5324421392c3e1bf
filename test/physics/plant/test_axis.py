"""A force-driven axis: slides to rest as the closed form says, sticks, and follows a steady force."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.physics.effects import unlisted
from shake_ros.physics.plant.axis import AXIS_LAYOUT, AxisParameters, initial_state, run_batch
from shake_ros.physics.plant.parameters import TableParameters

PARAMETERS = AxisParameters(mass=100.0, viscous=200.0, coulomb=20.0, offset=0.0)
AXIS = TableParameters(AXIS_LAYOUT, {"axis": PARAMETERS})


def free_run(table: TableParameters, forces: np.ndarray, velocity: float = 0.0, dt: float = 1e-3) -> np.ndarray:
    return np.asarray(run_batch(table.vector()[None, :], initial_state(0.0, velocity), forces, dt)[0])


def test_it_slides_to_rest_in_the_time_and_over_the_way_of_the_closed_form() -> None:
    out = free_run(AXIS, np.zeros(2000), velocity=0.1)
    rate, level = 2.0, 20.0 / 200.0  # F_v/M, F_c/F_v
    at_rest = math.log1p(0.1 / level) / rate
    way = (0.1 + level) * (1.0 - math.exp(-rate * at_rest)) / rate - level * at_rest
    assert np.argmax(out[:, 1] == 0.0) * 1e-3 == pytest.approx(at_rest, abs=2e-3)
    assert out[-1, 0] == pytest.approx(way, rel=1e-3)
    assert np.all(out[-100:, 1:] == 0.0)


def test_it_sticks_below_its_dry_friction_and_slides_above() -> None:
    assert np.all(free_run(AXIS, np.full(500, 19.9))[:, 1] == 0.0)
    assert free_run(AXIS, np.full(5000, 40.0))[-1, 1] == pytest.approx(20.0 / 200.0, rel=1e-3)


def test_the_offset_counts_against_the_force() -> None:
    table = AXIS.with_values({"axis.offset": -5.0})
    assert free_run(table, np.full(5000, 40.0))[-1, 1] == pytest.approx(25.0 / 200.0, rel=1e-3)


def test_presliding_springs_before_it_slides() -> None:
    table = AXIS.with_values({"effects.presliding_friction.distance": 1e-4})
    out = free_run(table, np.concatenate([np.full(1000, 10.0), np.zeros(1000)]))
    assert 0.2e-4 < out[999, 0] < 5e-4  # without friction 0.05 m
    assert out[-1, 0] < 0.9 * out[999, 0]


def test_friction_asymmetry_makes_dry_and_viscous_friction_differ_by_direction() -> None:
    table = AXIS.with_values({"effects.friction_asymmetry.asymmetry": 0.25})
    assert free_run(table, np.full(5000, 45.0))[-1, 1] == pytest.approx((45.0 - 25.0) / 250.0, rel=1e-3)
    assert free_run(table, np.full(5000, -45.0))[-1, 1] == pytest.approx(-(45.0 - 15.0) / 150.0, rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "low", "high", "nodes", "listed"),
    [
        (unlisted.FORCE_OF_POSITION, -0.2, 0.2, 50.0 * np.linspace(-0.2, 0.2, unlisted.NODES), "stiffness_to_ground"),
        (unlisted.FRICTION_OF_POSITION, -1.0, 1.0, np.full(unlisted.NODES, 5.0), "more dry friction"),
        (unlisted.FORCE_OF_VELOCITY, -0.3, 0.3, 30.0 * np.linspace(-0.3, 0.3, unlisted.NODES), "more viscous friction"),
    ],
)
def test_a_function_without_a_name_moves_the_axis_as_the_law_that_it_is(
    kind: int, low: float, high: float, nodes: np.ndarray, listed: str
) -> None:
    law = {
        "stiffness_to_ground": {"effects.stiffness_to_ground.stiffness": 50.0},
        "more dry friction": {"axis.coulomb": 25.0},
        "more viscous friction": {"axis.viscous": 230.0},
    }[listed]
    values = {f"effects.unlisted.node_{i:02d}": float(v) for i, v in enumerate(nodes)}
    function = {"effects.unlisted.kind": kind, "effects.unlisted.low": low, "effects.unlisted.high": high, **values}
    forces = 60.0 * np.sin(2.0 * np.pi * 0.5 * np.arange(3000) * 1e-3)
    declared, wanted = free_run(AXIS, forces), free_run(AXIS.with_values(law), forces)
    found = free_run(AXIS.with_values(function), forces)
    assert np.std(wanted[:, 1] - declared[:, 1]) > 0.01 * np.std(declared[:, 1])
    assert np.std(found[:, 1] - wanted[:, 1]) < 0.02 * np.std(wanted[:, 1] - declared[:, 1])


def of_two(kind: int, second: int, low: float, high: float, change: float) -> dict[str, float]:
    """A function that is zero in the middle of a second quantity and ±change at its ends."""
    own = {f"effects.unlisted.above_{i}": change for i in range(unlisted.CHANGES)}
    own |= {f"effects.unlisted.below_{i}": -change for i in range(unlisted.CHANGES)}
    ends = {"effects.unlisted.second_low": low, "effects.unlisted.second_high": high}
    return {"effects.unlisted.kind": kind, "effects.unlisted.second": second, **ends, **own}


@pytest.mark.parametrize(
    ("function", "law"),
    [
        (
            of_two(unlisted.FORCE_OF_VELOCITY, unlisted.POSITION, -0.4, 0.4, 20.0),
            {"effects.stiffness_to_ground.stiffness": 50.0},
        ),
        (of_two(unlisted.FORCE_OF_POSITION, unlisted.VELOCITY, -0.5, 0.5, 15.0), {"axis.viscous": 230.0}),
        (of_two(unlisted.FRICTION_OF_POSITION, unlisted.VELOCITY, -0.5, 0.5, 15.0), {"axis.viscous": 230.0}),
    ],
)
def test_a_function_whose_second_quantity_alone_counts_is_a_law_of_that(
    function: dict[str, float], law: dict[str, float]
) -> None:
    forces = 60.0 * np.sin(2.0 * np.pi * 0.5 * np.arange(3000) * 1e-3)
    declared, wanted = free_run(AXIS, forces), free_run(AXIS.with_values(law), forces)
    found = free_run(AXIS.with_values(function), forces)
    assert np.std(wanted[:, 1] - declared[:, 1]) > 0.01 * np.std(declared[:, 1])
    assert np.std(found[:, 1] - wanted[:, 1]) < 0.02 * np.std(wanted[:, 1] - declared[:, 1])


@pytest.mark.parametrize("begin", [0.0, 1.5])
def test_a_force_that_time_changes_follows_the_clock_of_the_recording(begin: float) -> None:
    time = begin + 1e-3 * np.arange(3000)
    forces = 60.0 * np.sin(2.0 * np.pi * 0.5 * time)
    ramp = AXIS.with_values(of_two(unlisted.FORCE_OF_POSITION, unlisted.TIME, 0.0, 5.0, 10.0))
    found = run_batch(ramp.vector()[None, :], initial_state(0.0, 0.0, begin), forces, 1e-3)[0]
    np.testing.assert_allclose(found, free_run(AXIS, forces - 10.0 * (time - 2.5) / 2.5), atol=1e-12)


def test_a_slow_transducer_is_followed_to_where_the_axis_is() -> None:
    slow = AXIS.with_values(
        {"effects.position_sensor_lag.time_constant": 0.09, "effects.stiffness_to_ground.stiffness": 4e3}
    )
    forces = 400.0 * np.sin(2.0 * np.pi * 1.0 * np.arange(2000) * 1e-3)
    free = free_run(slow, forces)
    followed = run_batch(slow.vector()[None, :], initial_state(0.0, 0.0), forces, 1e-3, free[:, 0])[0]
    np.testing.assert_allclose(followed, free, atol=2e-3 * np.max(np.abs(free)))
