"""The reduced table with effects: exact without them, physical with them, at any sampling rate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from shake_ros.packing import numbers
from shake_ros.physics.effects import EFFECTS
from shake_ros.physics.plant import reduced
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced import REDUCED_LAYOUT, ReducedParameters
from shake_ros.physics.plant.reduced_simulation import COLUMNS, exact_step, run
from shake_ros.quantities import ShakeError, UnknownName

BETA = ReducedParameters(beta1=-3600.0, beta2=-30.0, beta3=3000.0, beta4=-4.0, beta5=-100.0)
TABLE = TableParameters(REDUCED_LAYOUT, {"dynamics": BETA})
VELOCITY, ACCELERATION = COLUMNS.index("velocity"), COLUMNS.index("acceleration")
STRENGTHS = {
    "spool_deadband.width": 0.05,
    "spool_hysteresis.width": 0.05,
    "asymmetric_flow_gain.asymmetry": 0.2,
    "valve_null_shift.offset": 0.05,
    "slow_valve.time_constant": 0.01,
    "coulomb_friction.force": 0.5,
    "position_dependent_friction.curvature": 5e3,
    "quadratic_drag.coefficient": 5.0,
    "constant_force.force": 2.0,
    "stiffness_to_ground.stiffness": 200.0,
    "specimen_resonance.mass": 0.2,
    "accelerometer_scale.error": 0.1,
    "accelerometer_bias.bias": 0.2,
    "accelerometer_lag.time_constant": 0.01,
    "position_sensor_lag.time_constant": 0.01,
    "command_delay.delay": 0.0123,
}


def sine(rate: float, seconds: float = 1.5) -> np.ndarray:
    return 0.3 * np.sin(2.0 * np.pi * 2.0 * np.arange(round(seconds * rate)) / rate)


def steady(table: TableParameters, command: float) -> float:
    return float(run(table, np.full(400, command), 0.005)[-1, VELOCITY])


@pytest.mark.parametrize("h", [1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize(("a", "b"), [(-3600.0, -30.0), (-3600.0, -300.0), (-900.0, -60.0), (-0.5, -20.0)])
def test_a_step_is_the_matrix_exponential(a: float, b: float, h: float) -> None:
    matrix = np.zeros((4, 4))
    matrix[:2, :2] = [[0.0, 1.0], [a, b]]
    matrix[0, 2] = matrix[1, 3] = 1.0
    exact = expm(matrix * h)
    f11, f12, f21, f22, i11, i12 = exact_step(a, b, h)
    np.testing.assert_allclose([[f11, f12], [f21, f22]], exact[:2, :2], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose([i11, i12], [exact[0, 2], exact[0, 3]], rtol=1e-6)
    np.testing.assert_allclose([f11 - 1.0, f12], [exact[1, 2], exact[1, 3]], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_without_effects_it_is_the_exact_reduced_model(rate: float) -> None:
    commands, beta, state = sine(rate), numbers(BETA)[0], np.zeros(3)
    expected = []
    for u in commands:
        expected.append(state)
        state = reduced.advance(state, beta, u, 0.0, 1.0 / rate)
    np.testing.assert_allclose(
        run(TABLE, commands, 1.0 / rate)[:, 1:3], np.array(expected)[:, 1:], rtol=1e-9, atol=1e-12
    )


def test_every_effect_of_the_reduced_model_has_a_strength_here() -> None:
    shown = {name.partition(".")[0] for name in STRENGTHS} | {"friction_asymmetry"}  # that one acts on another
    assert shown == {name for name in REDUCED_LAYOUT.effects if name != "unlisted"}


@pytest.mark.parametrize("name", STRENGTHS)
def test_an_effect_shows_and_vanishes_with_its_strength(name: str) -> None:
    commands = sine(200.0)
    without = run(TABLE, commands, 0.005)
    there = run(TABLE.with_values({f"effects.{name}": STRENGTHS[name]}), commands, 0.005)
    hardly = run(TABLE.with_values({f"effects.{name}": 1e-6 * STRENGTHS[name]}), commands, 0.005)
    assert np.all(np.isfinite(there))
    size = np.max(np.abs(without[:, 1:3]), axis=0)
    assert np.max(np.abs(there - without)[:, 1:3] / size) > 0.01
    assert np.max(np.abs(hardly - without)[:, 1:3] / size) < 1e-3


@pytest.mark.parametrize("name", ["coulomb_friction.force", "quadratic_drag.coefficient", "specimen_resonance.mass"])
def test_the_sampling_rate_does_not_matter(name: str) -> None:
    table = TABLE.with_values({f"effects.{name}": STRENGTHS[name]})
    slow, held = sine(200.0), np.repeat(sine(200.0), 20)
    fine = run(table, held, 0.005 / 20)[::20]
    assert np.max(np.abs(run(table, slow, 0.005) - fine)[:, VELOCITY]) < 0.01 * np.max(np.abs(fine[:, VELOCITY]))


def test_dry_friction_holds_the_table_still_below_its_level() -> None:
    table = TABLE.with_values({"effects.coulomb_friction.force": 10.0})
    assert np.all(run(table, np.full(400, 0.05), 0.005)[:, 1:3] == 0.0)  # β_3 u/|β_2| = 5 m/s² only
    assert steady(table, 0.5) > 0.1


def test_dead_band_null_shift_and_unequal_edges_act_on_the_steady_velocity() -> None:
    gain = -BETA.beta3 / BETA.beta1
    beta = ReducedParameters(beta1=-3600.0, beta2=-30.0, beta3=3000.0, beta4=0.0, beta5=0.0)
    linear = TABLE.with_sections(dynamics=beta)
    dead = linear.with_values({"effects.spool_deadband.width": 0.1, "effects.valve_null_shift.offset": -0.05})
    assert steady(dead, 0.14) == 0.0
    assert steady(dead, 0.35) == pytest.approx(gain * 0.20, rel=1e-3)
    assert steady(dead, -0.35) == pytest.approx(-gain * 0.30, rel=1e-3)
    unequal = linear.with_values({"effects.asymmetric_flow_gain.asymmetry": 0.2})
    assert steady(unequal, 0.3) == pytest.approx(1.2 * gain * 0.3, rel=1e-3)
    assert steady(unequal, -0.3) == pytest.approx(-0.8 * gain * 0.3, rel=1e-3)


def test_forces_count_per_moved_mass_and_say_so() -> None:
    assert REDUCED_LAYOUT.fields["effects.constant_force.force"].metadata["unit"] == "m/s^2"
    assert EFFECTS["constant_force"].__dataclass_fields__["force"].metadata["unit"] == "N"


def test_a_reduced_table_comes_back_from_its_mapping() -> None:
    table = TABLE.with_values({"effects.spool_deadband.width": 0.1})
    assert REDUCED_LAYOUT.table(table.to_mapping(), "here") == table


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ({}, "missing section dynamics"),
        ({"dynamics": {}, "valve": {}}, "unknown section 'valve'"),
        ({"dynamics": {"beta1": -1.0}}, "missing beta2"),
        (
            {"dynamics": TABLE.to_mapping()["dynamics"], "effects": {"soft_zone": {}}},
            "unknown effect of the model reduced",
        ),
    ],
)
def test_a_wrong_reduced_table_is_refused_with_its_reason(content: dict[str, object], text: str) -> None:
    with pytest.raises(ShakeError, match=text):
        REDUCED_LAYOUT.table(content, "file.yaml")


def test_a_name_of_the_full_table_is_unknown_here() -> None:
    with pytest.raises(UnknownName, match=r"body\.piston_area"):
        TABLE.with_values({"body.piston_area": 1e-3})


def test_a_slow_transducer_is_followed_to_where_the_table_is() -> None:
    slow = TABLE.with_values(
        {"effects.position_sensor_lag.time_constant": 0.09, "effects.stiffness_to_ground.stiffness": 200.0}
    )
    free = run(slow, sine(1000.0), 1e-3)
    followed = run(slow, sine(1000.0), 1e-3, track=free[:, COLUMNS.index("position")])
    np.testing.assert_allclose(followed, free, atol=2e-3 * np.max(np.abs(free)))
