"""The linear model against closed forms, the reduced model and small sines through the whole plant."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.physics.plant.linearisation import linearise, oil_column_frequency, operating_point
from shake_ros.physics.plant.reduced import closed_form
from shake_ros.physics.plant.simulation import run
from shake_ros.physics.plant.states import POSITION, PRESSURE_A, PRESSURE_B, SPOOL, VELOCITY
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table

BERGAMO = load_table("bergamo")
SMOOTH = BERGAMO.with_values(  # without dry friction, leakage and the open centre: the oil spring alone
    {
        "friction.coulomb_level": 0.0,
        "friction.stribeck_rise": 0.0,
        "friction.viscous": 0.0,
        "leakage.internal": 0.0,
        "leakage.external": 0.0,
        "valve.underlap": 0.0,
    }
)


def swinging(poles: np.ndarray, near: float) -> complex:
    """The pole with positive imaginary part whose size is nearest."""
    upper = poles[poles.imag > 0.0]
    return complex(upper[np.argmin(np.abs(np.abs(upper) - near))])


@pytest.mark.parametrize("position", np.linspace(-0.11, 0.11, 9))
def test_oil_column_frequency_over_the_stroke_is_the_closed_form(position: float) -> None:
    expected = oil_column_frequency(SMOOTH, position)
    pole = swinging(linearise(SMOOTH, operating_point(SMOOTH, position)).poles(), expected)
    assert abs(pole) == pytest.approx(expected, rel=2e-3)
    assert abs(pole.real) < 0.02 * expected


def test_oil_column_by_hand_and_softest_in_the_middle() -> None:
    # k = 1.16e9 (9.4562e-4)² 2/(V_t/2), M = 650 kg
    by_hand = math.sqrt(1.16e9 * 9.4562e-4**2 * 2.0 / 1.2293e-4 / 650.0)
    assert oil_column_frequency(BERGAMO) == pytest.approx(by_hand, rel=1e-9)
    places = [oil_column_frequency(BERGAMO, x) for x in (0.0, 0.05, 0.1)]
    assert places[0] < places[1] < places[2]
    assert oil_column_frequency(BERGAMO, -0.07) == pytest.approx(oil_column_frequency(BERGAMO, 0.07))
    deeper = BERGAMO.with_values({"effects.dead_volume.volume": 1.2293e-4})
    assert oil_column_frequency(deeper) == pytest.approx(by_hand / math.sqrt(2.0))


def test_poles_of_the_valve_stand_in_the_linear_model() -> None:
    expected = 1600.0 * complex(-0.736, math.sqrt(1.0 - 0.736**2))
    assert swinging(linearise(BERGAMO).poles(), 1600.0) == pytest.approx(expected, rel=1e-4)


def test_one_pole_at_the_origin_for_the_position_and_all_others_stable() -> None:
    poles = linearise(BERGAMO, operating_point(BERGAMO, 0.03, 0.2)).poles()
    assert len(poles) == 6
    assert abs(poles[0]) < 1e-3
    assert np.all(poles[1:].real < 0.0)


def test_acceleration_has_two_zeros_at_the_origin_more_than_the_position() -> None:
    # the second zero of the acceleration meets the integrator of the position; both stand there
    model = linearise(BERGAMO, operating_point(BERGAMO, 0.02, 0.1))
    assert len(model.zeros("position")) == len(model.zeros("velocity")) - 1 == len(model.zeros("acceleration")) - 2
    for output, count in (("velocity", 1), ("acceleration", 2)):
        assert np.sum(np.abs(model.zeros(output)) < 1e-2) == count


def test_low_frequencies_follow_the_velocity_gain_of_the_reduced_model() -> None:
    still = SMOOTH.with_values({"friction.viscous": 100.0})
    beta = closed_form(still).beta
    # without underlap an edge is half open at the null: its gain for small signals is that of one edge, exactly u's
    model = linearise(still, operating_point(still, 0.0, 0.05))
    gain = abs(model.response("velocity", np.array([0.05]))[0])
    assert gain == pytest.approx(-beta.beta3 / beta.beta1, rel=0.02)
    assert abs(swinging(model.poles(), 161.0)) == pytest.approx(math.sqrt(-beta.beta1), rel=0.02)


@pytest.mark.parametrize("frequency", [10.0, 20.0, 40.0])
def test_a_small_sine_through_the_plant_has_the_linear_gain_and_phase(frequency: float) -> None:
    table = BERGAMO.with_values({"valve.hysteresis": 0.0})
    dt, periods, velocity, small = 1e-4, 12, 0.03, 0.002
    count = round(periods / frequency / dt)
    t = dt * np.arange(count)
    model = linearise(table, operating_point(table, 0.0, velocity))
    start = operating_point(table, -0.75 * velocity * count * dt, velocity)  # the second half passes the middle
    steady = run(table, np.full(count, start[SPOOL]), dt, state=start.copy())
    moved = run(table, start[SPOOL] + small * np.sin(2.0 * np.pi * frequency * t), dt, state=start.copy())
    half = slice(count // 2, None)  # whole periods after the transient
    difference = (moved - steady)[half, 2]
    phasor = 2.0j * np.mean(difference * np.exp(-2j * np.pi * frequency * t[half])) / small
    hold = np.exp(-1j * np.pi * frequency * dt)  # half a sample of the zero-order hold
    assert phasor == pytest.approx(model.response("acceleration", np.array([frequency]))[0] * hold, rel=0.05)


def test_an_operating_point_stays_where_it_is() -> None:
    state = operating_point(BERGAMO, 0.02, 0.15)
    assert state[POSITION] == 0.02
    assert state[VELOCITY] == 0.15
    result = run(BERGAMO.with_values({"valve.hysteresis": 0.0}), np.full(20, state[SPOOL]), 1e-3, state=state)
    np.testing.assert_allclose(result[:, 1], 0.15, atol=1e-5)
    assert result[0, 2] == pytest.approx(0.0, abs=1e-6)
    load = BERGAMO.body.piston_area * (state[PRESSURE_A] - state[PRESSURE_B])
    assert load == pytest.approx(80.0 + 160.0 * math.exp(-2.5 * 0.15) + 2.0 * 0.15, rel=1e-6)


def test_effects_bring_their_own_poles() -> None:
    specimen = {"effects.specimen_resonance.mass": 20.0, "effects.specimen_resonance.frequency": 6.0}
    poles = linearise(BERGAMO.with_values(specimen), None).poles()
    assert len(poles) == 8
    assert abs(swinging(poles, 2.0 * math.pi * 6.0)) == pytest.approx(2.0 * math.pi * 6.0, rel=0.1)


def test_backlash_is_closed_rod_and_table_are_two_masses_on_the_oil_and_the_contact() -> None:
    backlash = {"gap": 1e-3, "stiffness": 2e7, "rod_mass": 40.0, "damping": 0.0}
    worn = SMOOTH.with_values({f"effects.coupling_backlash.{name}": value for name, value in backlash.items()})
    rod, table, contact = 40.0, 610.0, 2e7
    oil = oil_column_frequency(SMOOTH) ** 2 * (rod + table)
    stiffness = np.array([[(oil + contact) / rod, -contact / rod], [-contact / table, contact / table]])
    expected = np.sort(np.sqrt(np.linalg.eigvals(stiffness)))
    poles = linearise(worn, operating_point(worn, 0.0, 0.0)).poles()
    assert [abs(swinging(poles, w)) for w in expected] == pytest.approx(expected, rel=2e-3)


def test_a_velocity_that_the_valve_cannot_give_is_refused() -> None:
    with pytest.raises(ShakeError, match="no opening of the valve"):
        operating_point(BERGAMO, 0.0, 5.0)
    with pytest.raises(ShakeError, match="none of"):
        linearise(BERGAMO).zeros("force")
