"""The effect without a name: each kind acts where it says, on what it says, and is what a listed law would be."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.plant import reference_model as reference
from shake_ros.physics.effects import unlisted
from shake_ros.physics.plant.parameters import records
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table

SAMPLE = 0.001
BERGAMO = load_table("bergamo")
COMMANDS = reference.sine(0.4, 3.0, 1.0)


def unnamed(kind: int, low: float, high: float, values: np.ndarray) -> dict[str, float]:
    """Dotted names of an unlisted function with values on its nodes."""
    nodes = {f"effects.unlisted.node_{i:02d}": float(v) for i, v in enumerate(values)}
    return {"effects.unlisted.kind": kind, "effects.unlisted.low": low, "effects.unlisted.high": high, **nodes}


def ramp(low: float, high: float) -> np.ndarray:
    """Arguments of the nodes."""
    return np.linspace(low, high, unlisted.NODES)


SAME_AS_A_LISTED_LAW = {
    "force of position is a spring": (
        unnamed(unlisted.FORCE_OF_POSITION, -0.05, 0.05, 2e4 * ramp(-0.05, 0.05)),
        {"effects.stiffness_to_ground.stiffness": 2e4},
    ),
    "friction of position has a gradient": (
        unnamed(unlisted.FRICTION_OF_POSITION, -0.05, 0.05, 500.0 + 3e3 * ramp(-0.05, 0.05)),
        {"friction.coulomb_level": 580.0, "effects.position_dependent_friction.gradient": 3e3},
    ),
    "a factor of friction that position leaves alone is another level": (
        unnamed(unlisted.FRICTION_FACTOR_OF_POSITION, -0.05, 0.05, np.full(unlisted.NODES, 0.5)),
        {name: 1.5 * BERGAMO.value(name) for name in ("friction.coulomb_level", "friction.stribeck_rise")},
    ),
    "force of velocity is viscous": (
        unnamed(unlisted.FORCE_OF_VELOCITY, -0.5, 0.5, 800.0 * ramp(-0.5, 0.5)),
        {"friction.viscous": 802.0},
    ),
    "flow gain of opening is another valve": (
        unnamed(unlisted.FLOW_GAIN_OF_OPENING, -1.0, 1.0, np.full(unlisted.NODES, 0.1)),
        {"valve.flow_coefficient": 1.1 * 1.81e-7},
    ),
    "leakage of load pressure is laminar": (
        unnamed(unlisted.LEAKAGE_OF_LOAD_PRESSURE, -2e7, 2e7, 3e-12 * ramp(-2e7, 2e7)),
        {"leakage.internal": 4e-12},
    ),
    "stiffness of load pressure is another oil": (
        unnamed(unlisted.STIFFNESS_OF_LOAD_PRESSURE, -2e7, 2e7, np.full(unlisted.NODES, -0.3)),
        {"bulk_modulus.modulus": 0.7 * 1.16e9},
    ),
    "flow gain that time leaves alone is another valve": (
        unnamed(unlisted.FLOW_GAIN_OF_TIME, 0.0, 1.0, np.full(unlisted.NODES, 0.1)),
        {"valve.flow_coefficient": 1.1 * 1.81e-7},
    ),
    "supply of a constant phase function is another supply": (
        unnamed(unlisted.SUPPLY_OF_PHASE, 0.0, 0.2, np.full(unlisted.NODES, -0.1)),
        {"supply.supply_pressure": 0.9 * 206e5},
    ),
}


def alike(first: dict[str, float], second: dict[str, float]) -> bool:
    """Whether two changes of the table move it in the same way, which is not that of the declared table."""
    declared, one, other = (run(BERGAMO.with_values(own), COMMANDS, SAMPLE)[:, 2] for own in ({}, first, second))
    assert np.std(other - declared) > 5e-3 * np.std(declared)
    return bool(np.std(one - other) < 2e-2 * np.std(other - declared))


@pytest.mark.parametrize("name", SAME_AS_A_LISTED_LAW)
def test_a_function_that_is_a_listed_law_moves_the_table_as_the_law_does(name: str) -> None:
    assert alike(*SAME_AS_A_LISTED_LAW[name])


def test_absent_whatever_its_nodes_say_at_kind_zero() -> None:
    table = BERGAMO.with_values(unnamed(0, -1.0, 1.0, np.full(unlisted.NODES, 1e3)))
    np.testing.assert_array_equal(run(table, COMMANDS, SAMPLE), run(BERGAMO, COMMANDS, SAMPLE))


def test_between_nodes_the_function_is_linear() -> None:
    values = np.arange(unlisted.NODES, dtype=float) ** 2
    p = records(BERGAMO.with_values(unnamed(3, 0.0, 15.0, values)).vector())[0]
    assert unlisted.interpolated(p, 3.5) == pytest.approx(12.5)


def test_beyond_its_range_a_spring_goes_on_and_friction_stays() -> None:
    values = np.arange(unlisted.NODES, dtype=float)
    spring = records(BERGAMO.with_values(unnamed(unlisted.FORCE_OF_POSITION, 0.0, 15.0, values)).vector())[0]
    friction = records(BERGAMO.with_values(unnamed(unlisted.FRICTION_OF_POSITION, 0.0, 15.0, values)).vector())[0]
    assert unlisted.interpolated(spring, 20.0) == pytest.approx(20.0)
    assert unlisted.interpolated(spring, -5.0) == pytest.approx(-5.0)
    assert unlisted.interpolated(friction, 20.0) == 15.0
    assert unlisted.interpolated(friction, -5.0) == 0.0


def test_a_flow_gain_of_time_is_another_valve_from_then_on() -> None:
    late = np.where(ramp(0.0, 1.0) > 0.55, 0.3, 0.0)
    with_function = run(BERGAMO.with_values(unnamed(unlisted.FLOW_GAIN_OF_TIME, 0.0, 1.0, late)), COMMANDS, SAMPLE)
    declared = run(BERGAMO, COMMANDS, SAMPLE)
    stronger = run(BERGAMO.with_values({"valve.flow_coefficient": 1.3 * 1.81e-7}), COMMANDS, SAMPLE)
    np.testing.assert_array_equal(with_function[:500], declared[:500])
    np.testing.assert_allclose(with_function[-200:, 1], stronger[-200:, 1], rtol=0.02, atol=2e-3)


def test_the_function_of_phase_closes_upon_itself() -> None:
    values = np.sin(2.0 * np.pi * np.arange(unlisted.NODES) / unlisted.NODES)
    p = records(BERGAMO.with_values(unnamed(unlisted.SUPPLY_OF_PHASE, 0.0, 0.25, values)).vector())[0]
    times = np.linspace(0.0, 1.0, 201)
    found = [unlisted.interpolated(p, t) for t in times]
    np.testing.assert_allclose(found, np.sin(2.0 * np.pi * times / 0.25), atol=0.03)
    assert unlisted.interpolated(p, 0.1) == pytest.approx(unlisted.interpolated(p, 7.35))


def changed(second: int, low: float, high: float, above: float, below: float) -> dict[str, float]:
    """Dotted names of a change by a second quantity that is the same at every argument."""
    ends = {"effects.unlisted.second_low": low, "effects.unlisted.second_high": high}
    own = {f"effects.unlisted.above_{i}": above for i in range(unlisted.CHANGES)}
    own |= {f"effects.unlisted.below_{i}": below for i in range(unlisted.CHANGES)}
    return {"effects.unlisted.second": second, **ends, **own}


NOTHING = np.zeros(unlisted.NODES)
SAME_OF_TWO = {
    "a force of position that changes with velocity is viscous": (
        unnamed(unlisted.FORCE_OF_POSITION, -0.1, 0.1, NOTHING) | changed(unlisted.VELOCITY, -0.5, 0.5, 400.0, -400.0),
        {"friction.viscous": 802.0},
    ),
    "a force of velocity that changes with position is a spring": (
        unnamed(unlisted.FORCE_OF_VELOCITY, -0.5, 0.5, NOTHING) | changed(unlisted.POSITION, -0.1, 0.1, 2e3, -2e3),
        {"effects.stiffness_to_ground.stiffness": 2e4},
    ),
    "friction of position that changes with speed is viscous": (
        unnamed(unlisted.FRICTION_OF_POSITION, -0.1, 0.1, np.full(unlisted.NODES, 200.0))
        | changed(unlisted.VELOCITY, 0.0, 0.5, 200.0, -200.0),
        {"friction.viscous": 802.0},
    ),
    "a flow gain of opening that time changes is one of time": (
        unnamed(unlisted.FLOW_GAIN_OF_OPENING, -1.0, 1.0, np.full(unlisted.NODES, 0.1))
        | changed(unlisted.TIME, 0.0, 1.0, 0.1, -0.1),
        unnamed(unlisted.FLOW_GAIN_OF_TIME, 0.0, 1.0, 0.2 * ramp(0.0, 1.0)),
    ),
    "a flow gain of time that the opening changes is one of opening": (
        unnamed(unlisted.FLOW_GAIN_OF_TIME, 0.0, 1.0, np.full(unlisted.NODES, 0.1))
        | changed(unlisted.VALVE_OPENING, -1.0, 1.0, 0.1, -0.1),
        unnamed(unlisted.FLOW_GAIN_OF_OPENING, -1.0, 1.0, 0.1 + 0.1 * ramp(-1.0, 1.0)),
    ),
}


@pytest.mark.parametrize("name", SAME_OF_TWO)
def test_a_function_of_two_quantities_that_needs_only_the_second_is_one_of_that(name: str) -> None:
    assert alike(*SAME_OF_TWO[name])


SIZES = {1: 200.0, 2: 100.0, 3: 200.0, 4: 0.1, 5: 1e-5, 6: 0.3, 7: 0.1, 9: 0.5}
SPANS = {"position": 0.05, "velocity": 0.5, "valve_opening": 1.0, "load_pressure": 1e7, "time": 0.5}


@pytest.mark.parametrize(("kind", "second"), [(k, s) for k, seconds in unlisted.PAIRS.items() for s in seconds])
def test_every_second_quantity_is_at_hand_where_its_kind_acts(kind: int, second: int) -> None:
    span = SPANS[unlisted.SECONDS[second]]
    function = unnamed(kind, -1.0, 1.0, np.full(unlisted.NODES, SIZES[kind]))
    change = changed(second, -span, span, SIZES[kind], -SIZES[kind])
    alone = run(BERGAMO.with_values(function), COMMANDS, SAMPLE)
    both = run(BERGAMO.with_values(function | change), COMMANDS, SAMPLE)
    assert np.all(np.isfinite(both))
    assert np.std(both[:, 2] - alone[:, 2]) > 1e-3 * np.std(alone[:, 2])


def test_without_a_second_quantity_changes_are_absent_whatever_their_nodes_say() -> None:
    function = unnamed(unlisted.FORCE_OF_POSITION, -0.05, 0.05, 2e4 * ramp(-0.05, 0.05))
    loud = changed(unlisted.NO_SECOND, -1.0, 1.0, 1e3, -1e3)
    once, again = (run(BERGAMO.with_values(v), COMMANDS, SAMPLE) for v in (function, function | loud))
    np.testing.assert_array_equal(once, again)


def test_the_change_grows_in_proportion_to_the_distance_from_the_middle_and_ends_at_the_ends() -> None:
    function = unnamed(unlisted.FRICTION_OF_POSITION, 0.0, 7.0, np.full(unlisted.NODES, 10.0))
    above = {f"effects.unlisted.above_{i}": float(i * i) for i in range(unlisted.CHANGES)}
    values = function | changed(unlisted.TIME, 2.0, 6.0, 0.0, -4.0) | above
    p = records(BERGAMO.with_values(values).vector())[0]

    def at(clock: float) -> float:
        return float(unlisted.value(p, unlisted.FRICTION_OF_POSITION, 2.5, clock=clock))

    assert at(4.0) == pytest.approx(10.0)
    assert at(5.0) == pytest.approx(10.0 + 0.5 * 6.5)
    assert at(6.0) == at(99.0) == pytest.approx(16.5)
    assert at(3.0) == pytest.approx(8.0)
    assert at(2.0) == at(0.0) == pytest.approx(6.0)


def test_a_second_quantity_that_is_not_known_where_the_kind_acts_is_refused() -> None:
    with pytest.raises(ShakeError, match="second = 1: kind 4 can have 0, 4, 5"):
        unlisted.Unlisted(kind=unlisted.FLOW_GAIN_OF_OPENING, second=unlisted.POSITION)
    with pytest.raises(ShakeError, match="kind 8 can have 0"):
        unlisted.Unlisted(kind=unlisted.SUPPLY_OF_PHASE, second=unlisted.TIME)
