"""Every bulk-modulus law as the chambers of the plant see it: against its closed form, written here once more."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from watched_pressures import findings_of_run

from shake_ros.physics.bulk_modulus import BULK_MODULI
from shake_ros.physics.effects.hydraulics import factor as soft_zone
from shake_ros.physics.plant.linearisation import linearise, oil_column_frequency, operating_point
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters, records
from shake_ros.physics.plant.right_hand_side import active_states, right_hand_side
from shake_ros.physics.plant.simulation import initial_state, run
from shake_ros.physics.plant.states import CONTINUOUS, LINE_FLOW_A, LINE_PRESSURE_A, PRESSURE_A, PRESSURE_B, VELOCITY
from shake_ros.quantities import ShakeError, UnknownName
from shake_ros.settings import config_folder, load_table, load_variant, read_yaml

BERGAMO = load_table("bergamo")
SEALED = {"valve.underlap": -0.1, "leakage.internal": 0.0, "leakage.external": 0.0}  # nothing but the piston moves oil
KAPPA, SPEED = 1.4, 0.1


def air(pressure: float) -> float:
    return 0.01 * (1e5 / pressure) ** (1.0 / KAPPA)


def of_ifas(p: float) -> float:
    liquid = 0.99 * (1.0 + 10.0 * (p - 1e5) / 1.6e9) ** -0.1
    return (liquid + air(p)) / (liquid / (1.6e9 + 10.0 * (p - 1e5)) + air(p) / (KAPPA * p))


def of_nykanen(p: float) -> float:
    density = 1.0 + (p - 1e5) / 1.6e9
    return (air(p) + 0.99 / density) ** 2 / (air(p) / (KAPPA * p) + 0.99 / (1.6e9 * density**2))


CLOSED: dict[str, Callable[[float], float]] = {  # with the numbers of config/bulk_modulus
    "constant": lambda p: 1.6e9,
    "linear": lambda p: 1.6e9 + 10.0 * p,
    "lee": lambda p: 0.9e9 * math.log10(90.0 * p / 280e5 + 3.0),
    "hoffmann": lambda p: 1.8e9 * (1.0 - math.exp(-0.4 - 2e-7 * p)),
    "eggerth": lambda p: 1.0 / (4.943e-10 + 1.954e-10 * (1e6 / p) ** 1.48),
    "wylie_kajaste": lambda p: 1.0 / ((1.0 - air(p)) / 1.6e9 + air(p) / (KAPPA * p)),
    "nykanen": of_nykanen,
    "backe_murrenhoff": lambda p: 1.01 / (1.0 / 1.6e9 + air(p) / (KAPPA * p)),
    "ifas": of_ifas,
}
PRESSURES = (0.1e6, 1e6, 10e6)


def table(kind: str, values: dict[str, float] | None = None) -> TableParameters:
    """The declared table with a law of config/bulk_modulus."""
    law = load_variant("bulk_modulus", kind, BULK_MODULI)[1]
    return BERGAMO.with_sections(bulk_modulus=law).with_values(values or {})


def moduli_in_the_plant(one: TableParameters, pressure_a: float, pressure_b: float) -> tuple[float, float]:
    """E of both chambers from the rates of a sealed cylinder whose piston moves: ∓E A v/V (6.5), (6.6)."""
    vector = one.with_values(SEALED).vector()
    p, y, rates = records(vector)[0], initial_state(vector), np.zeros(CONTINUOUS)
    y[PRESSURE_A], y[PRESSURE_B] = pressure_a, pressure_b
    y[VELOCITY] = SPEED
    right_hand_side(p, y, y, 0.0, 0.0, active_states(p), rates)
    swept = one.body.piston_area * SPEED
    volume = 0.5 * one.body.cylinder_volume + one.value("effects.dead_volume.volume")
    return -rates[PRESSURE_A] * volume / swept, rates[PRESSURE_B] * volume / swept


def test_every_law_of_the_family_is_checked_here() -> None:
    assert set(CLOSED) == set(BULK_MODULI)


@pytest.mark.parametrize("pressure", PRESSURES)
@pytest.mark.parametrize("kind", CLOSED)
def test_a_chamber_has_the_closed_form_of_the_law(kind: str, pressure: float) -> None:
    found = moduli_in_the_plant(table(kind), pressure, 5e6)
    assert found == pytest.approx((CLOSED[kind](pressure), CLOSED[kind](5e6)), rel=1e-12)


@pytest.mark.parametrize("kind", CLOSED)
def test_effects_on_the_oil_act_on_top_of_every_law(kind: str) -> None:
    p_a, p_b, law = 3e6, 9e6, CLOSED[kind]
    slope = table(kind, {"effects.pressure_dependent_bulk_modulus.slope": 7.0})
    p_0 = slope.value("bulk_modulus.reference_pressure")
    expected = law(p_a) + 7.0 * (p_a - p_0), law(p_b) + 7.0 * (p_b - p_0)
    assert moduli_in_the_plant(slope, p_a, p_b) == pytest.approx(expected, rel=1e-12)
    soft = {"effects.soft_zone.depth": 0.6, "effects.soft_zone.threshold": 9e5, "effects.soft_zone.sharpness": 8e-6}
    h = soft_zone(p_a - p_b, 0.6, 9e5, 8e-6)
    both = table(kind, soft | {"effects.dead_volume.volume": 3e-5})
    assert moduli_in_the_plant(both, p_a, p_b) == pytest.approx((h * law(p_a), h * law(p_b)), rel=1e-12)
    airy = moduli_in_the_plant(table(kind, {"effects.entrained_air.fraction": 0.01}), p_a, p_b)
    for found, p in zip(airy, (p_a, p_b), strict=True):
        free, liquid = 0.01 * (p_0 / p) ** (1.0 / KAPPA), 0.99 * math.exp(-(p - p_0) / law(p))
        assert found == pytest.approx((liquid + free) / (liquid / law(p) + free / (KAPPA * p)), rel=1e-12)


def test_air_on_top_of_a_liquid_that_stiffens_is_IFAS_to_a_thousandth() -> None:
    # the liquid's volume is taken with the E that the law has at this pressure: no more than that is left out
    airy = table("linear", {"effects.entrained_air.fraction": 0.01, "bulk_modulus.modulus": 1.6e9 - 10.0 * 1e5})
    for pressure in (0.1e6, 1e6, 10e6, 20e6):
        assert moduli_in_the_plant(airy, pressure, 5e6)[0] == pytest.approx(of_ifas(pressure), rel=1e-3)


@pytest.mark.parametrize("kind", CLOSED)
def test_a_tables_file_names_its_law_and_gives_it_back(kind: str) -> None:
    content = BERGAMO.to_mapping() | {"bulk_modulus": read_yaml(config_folder() / "bulk_modulus" / f"{kind}.yaml")}
    built = FULL_LAYOUT.table(content, "here")
    assert built == table(kind)
    again = FULL_LAYOUT.table(built.to_mapping(), "here")
    assert again == built
    assert ("kind" in built.to_mapping()["bulk_modulus"]) == (kind != "constant")


def test_a_wrong_law_or_number_is_named() -> None:
    content = BERGAMO.to_mapping()
    with pytest.raises(UnknownName, match=r"unknown bulk_modulus kind 'le' .*known: backe_murrenhoff, constant"):
        FULL_LAYOUT.table(content | {"bulk_modulus": {"kind": "le"}}, "here")
    with pytest.raises(UnknownName, match="here: bulk_modulus: unknown parameter 'modulus'"):
        FULL_LAYOUT.table(content | {"bulk_modulus": {"kind": "lee", "modulus": 1e9}}, "here")
    with pytest.raises(ShakeError, match="here: bulk_modulus: missing largest_modulus"):
        FULL_LAYOUT.table(content | {"bulk_modulus": {"kind": "lee"}}, "here")
    assert table("lee").with_values({"bulk_modulus.largest_modulus": 1.5e9}).value("bulk_modulus.a1") == 0.5


def test_a_law_that_does_not_stiffen_gives_the_run_of_a_constant_modulus_to_the_bit() -> None:
    commands = 0.3 * np.sin(2.0 * np.pi * 3.0 * np.arange(400) * 1e-3)
    flat = table("linear", {"bulk_modulus.slope": 0.0, "bulk_modulus.modulus": 1.16e9})
    np.testing.assert_array_equal(run(flat, commands, 1e-3), run(BERGAMO, commands, 1e-3))


@pytest.mark.parametrize("kind", CLOSED)
def test_a_strong_run_under_every_law_stays_finite_and_within_its_bounds(kind: str) -> None:
    commands = 0.8 * np.sin(2.0 * np.pi * 2.0 * np.arange(1500) * 1e-3)
    one = table(kind, {"bulk_modulus.modulus": 1.2e9} if hasattr(table(kind).bulk_modulus, "modulus") else {})
    result = run(one, commands, 1e-3)
    assert np.isfinite(result).all()
    assert not np.array_equal(result, run(BERGAMO, commands, 1e-3))
    assert not [finding for finding in findings_of_run(one, result, 1e-3) if "above" in finding]


def test_pipelines_have_the_oil_of_the_law() -> None:
    pipes = {"pipelines.length": 2.0, "pipelines.diameter": 0.02, "pipelines.density": 870.0}
    vector = table("lee", SEALED | pipes).vector()
    p, y, rates = records(vector)[0], initial_state(vector), np.zeros(CONTINUOUS)
    y[LINE_PRESSURE_A] = 4e6
    y[LINE_FLOW_A] = 1e-4  # flow of line A out of the half at the valve
    right_hand_side(p, y, y, 0.0, 0.0, active_states(p), rates)
    half = math.pi / 4.0 * 0.02**2 * 1.0
    assert -rates[LINE_PRESSURE_A] * half / 1e-4 == pytest.approx(CLOSED["lee"](4e6), rel=1e-12)


@pytest.mark.parametrize("kind", CLOSED)
def test_the_linear_model_swings_with_the_modulus_of_the_law_at_rest(kind: str) -> None:
    frictionless = dict.fromkeys(("friction.coulomb_level", "friction.stribeck_rise", "friction.viscous"), 0.0)
    smooth = table(kind, frictionless | {"leakage.internal": 0.0, "leakage.external": 0.0, "valve.underlap": 0.0})
    expected = math.sqrt(CLOSED[kind](0.5 * 207e5) * 9.4562e-4**2 * 2.0 / 1.2293e-4 / 650.0)
    assert oil_column_frequency(smooth) == pytest.approx(expected, rel=1e-9)
    poles = linearise(smooth, operating_point(smooth)).poles()
    upper = poles[poles.imag > 0.0]
    assert np.min(np.abs(np.abs(upper) - expected)) < 2e-3 * expected
