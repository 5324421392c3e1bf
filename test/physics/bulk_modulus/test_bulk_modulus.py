"""Bulk-modulus laws against derivatives of their volumes, table 2.2, hand values and the tube of Lamé; contracts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.physics.bulk_modulus import BULK_MODULI, BulkModulusLaw, ifas, moduli, nykanen, stiffness
from shake_ros.physics.effects.hydraulics import factor as soft_zone
from shake_ros.settings import config_folder, load_variant

NAMES = sorted(path.stem for path in (config_folder() / "bulk_modulus").glob("*.yaml"))
PRESSURES = np.array([2e5, 10e5, 50e5, 100e5, 200e5, 300e5])
LIQUID, ALPHA, KAPPA, P_0 = 1.6e9, 0.02, 1.3, 1e5
MIXTURE = {"modulus": LIQUID, "fraction": ALPHA, "polytropic_exponent": KAPPA, "reference_pressure": P_0}


def law(name: str) -> BulkModulusLaw:
    return load_variant("bulk_modulus", name, BULK_MODULI)[1]


def modulus(name: str, pressure: float, **numbers: float) -> float:
    """E of a law with some of its numbers changed."""
    return float(moduli(law(name).replace(**numbers), np.array([pressure]))[0])


def slope(function, pressure: float) -> float:
    """Central difference, good to about 1e-9 relative."""
    step = 1e-4 * pressure
    return (function(pressure + step) - function(pressure - step)) / (2.0 * step)


def test_every_law_has_a_configuration() -> None:
    assert {load_variant("bulk_modulus", name, BULK_MODULI)[0] for name in NAMES} == set(BULK_MODULI)


@pytest.mark.parametrize("name", NAMES)
def test_modulus_is_positive_never_falls_with_pressure_and_leaves_the_input(name: str) -> None:
    pressures = np.linspace(2e5, 280e5, 300)
    copy = pressures.copy()
    found = moduli(law(name), pressures)
    assert found.shape == pressures.shape
    assert np.all(found > 0.0)
    assert np.all(np.diff(found) >= -1e-6 * found[:-1])
    np.testing.assert_array_equal(pressures, copy)


def test_every_law_has_a_number_of_its_own() -> None:
    assert len({member.code for member in BULK_MODULI.values()}) == len(BULK_MODULI)


@pytest.mark.parametrize("name", sorted(set(NAMES) - {"wylie_kajaste", "nykanen", "backe_murrenhoff", "ifas"}))
def test_a_scaled_law_is_stiffer_at_every_pressure_by_the_factor(name: str) -> None:
    one = law(name)
    np.testing.assert_allclose(moduli(one.replace(**one.scaled(0.8)), PRESSURES), 0.8 * moduli(one, PRESSURES), 1e-12)


@pytest.mark.parametrize("name", ["wylie_kajaste", "nykanen", "backe_murrenhoff", "ifas"])
def test_the_liquid_of_a_scaled_mixture_is_stiffer_by_the_factor(name: str) -> None:
    pure = law(name).replace(fraction=0.0, reference_pressure=P_0)
    scaled = pure.replace(**pure.scaled(0.8))
    np.testing.assert_allclose(moduli(scaled, PRESSURES), 0.8 * moduli(pure, PRESSURES), 1e-12)


@pytest.mark.parametrize("name", ["wylie_kajaste", "nykanen", "backe_murrenhoff", "ifas"])
def test_air_softens_less_the_higher_the_pressure_and_without_it_the_liquid_remains(name: str) -> None:
    mixture = law(name)
    pure = mixture.replace(fraction=0.0)
    lost = 1.0 - moduli(mixture, PRESSURES) / moduli(pure, PRESSURES)
    assert np.all(lost[:4] > 0.0)
    assert np.all(np.diff(lost) < 0.0)
    slope_m = getattr(mixture, "slope", 0.0)
    np.testing.assert_allclose(moduli(pure, PRESSURES), 1.6e9 + slope_m * (PRESSURES - P_0), rtol=1e-12)


@pytest.mark.parametrize("pressure", PRESSURES)
def test_Wylie_adds_the_compliances_of_liquid_and_air(pressure: float) -> None:
    share = ALPHA * (P_0 / pressure) ** (1.0 / KAPPA)
    compliance = (1.0 - share) / LIQUID + share / (KAPPA * pressure)
    assert modulus("wylie_kajaste", pressure, **MIXTURE) == pytest.approx(1.0 / compliance, rel=1e-12)


@pytest.mark.parametrize("pressure", PRESSURES)
def test_Nykanen_is_the_squared_volume_over_its_slope(pressure: float) -> None:
    numbers = (LIQUID, ALPHA, KAPPA, P_0)
    volume = nykanen.relative_volume(pressure, *numbers)
    falling = -slope(lambda p: nykanen.relative_volume(p, *numbers), pressure)
    assert modulus("nykanen", pressure, **MIXTURE) == pytest.approx(volume**2 / falling, rel=1e-6)


@pytest.mark.parametrize("pressure", PRESSURES)
def test_Backe_and_Murrenhoff_relate_the_slope_to_the_first_volume(pressure: float) -> None:
    falling = -slope(lambda p: 1.0 - (p - P_0) / LIQUID + ALPHA * (P_0 / p) ** (1.0 / KAPPA), pressure)
    expected = (1.0 + ALPHA) / falling
    assert modulus("backe_murrenhoff", pressure, **MIXTURE) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("m", [0.0, 9.0])
@pytest.mark.parametrize("pressure", PRESSURES)
def test_IFAS_is_the_tangent_modulus_of_its_volume(pressure: float, m: float) -> None:
    numbers = (LIQUID, m, ALPHA, KAPPA, P_0)
    rate = slope(lambda p: ifas.relative_volume(p, *numbers), pressure)
    expected = stiffness.tangent(ifas.relative_volume(pressure, *numbers), 1.0 / rate)
    assert modulus("ifas", pressure, slope=m, **MIXTURE) == pytest.approx(expected, rel=1e-6)


def test_IFAS_in_its_printed_form() -> None:
    # (2.32) term by term at P = 50 bar
    p, m = 50e5, 9.0
    liquid = (1.0 - ALPHA) * (1.0 + m * (p - P_0) / LIQUID) ** (-1.0 / m)
    upper = liquid + ALPHA * (P_0 / p) ** (1.0 / KAPPA)
    lower = (1.0 - ALPHA) / LIQUID * (1.0 + m * (p - P_0) / LIQUID) ** (-(m + 1.0) / m)
    lower += ALPHA / (KAPPA * P_0) * (P_0 / p) ** ((KAPPA + 1.0) / KAPPA)
    assert modulus("ifas", p, slope=m, **MIXTURE) == pytest.approx(upper / lower, rel=1e-12)


def test_IFAS_stays_finite_and_positive_where_a_chamber_cavitates() -> None:
    for pressure in (-1e7, 0.0, 1.0, 999.0):
        assert 0.0 < modulus("ifas", pressure, slope=9.0, **MIXTURE) < LIQUID


def test_Lee_Hoffmann_and_Eggerth_by_hand() -> None:
    assert modulus("lee", 280e5) == pytest.approx(0.9e9 * math.log10(93.0))
    assert modulus("lee", 1e3) == pytest.approx(0.9e9 * 0.4776, rel=1e-4)  # log10(3 + 90/28000)
    assert modulus("hoffmann", 5e6) == pytest.approx(1.8e9 * (1.0 - math.exp(-1.4)))
    assert modulus("eggerth_50", 100e5) == pytest.approx(1e10 / (5.469 + 3.2785 / 10.0**1.258))
    assert modulus("eggerth", 10e5) == pytest.approx(1e10 / (4.943 + 1.954))
    assert modulus("linear", 100e5) == pytest.approx(1.6e9 + 1e8)


def test_warm_oil_is_softer_after_Eggerth() -> None:
    found = [moduli(law(name), PRESSURES) for name in ("eggerth", "eggerth_50", "eggerth_90")]
    assert np.all(found[0] > found[1])
    assert np.all(found[1] > found[2])


def test_adiabatic_and_isothermal_moduli_of_table_2_2_have_one_ratio() -> None:
    adiabatic_secant, adiabatic_tangent, isothermal_secant, isothermal_tangent = 2.15e9, 2.41e9, 1.88e9, 2.15e9
    ratio = adiabatic_tangent / isothermal_tangent  # C_p/C_v = 1.12
    assert stiffness.adiabatic_from_isothermal(isothermal_tangent, ratio) == adiabatic_tangent
    assert stiffness.adiabatic_from_isothermal(isothermal_secant, ratio) == pytest.approx(adiabatic_secant, rel=0.025)


@pytest.mark.parametrize(("secant", "tangent"), [(2.15e9, 2.41e9), (1.88e9, 2.15e9)])
def test_tangent_moduli_of_table_2_2_follow_from_the_secant_ones(secant: float, tangent: float) -> None:
    # 50 MPa; the secant modulus of mineral oil rises by 5 to 6 per unit of pressure
    assert stiffness.tangent_from_secant(secant, 50e6, 5.3) == pytest.approx(tangent, rel=0.02)


def test_tangent_from_secant_is_the_derivative_of_the_volume() -> None:
    e_0, m = 1.7e9, 5.3

    def volume(p: float) -> float:
        return 1.0 - p / (e_0 + m * p)  # (2.12) with V_0 = 1 and a secant modulus E_0 + m P

    for pressure in (1e6, 2e7, 1e8):
        expected = stiffness.tangent(volume(pressure), 1.0 / slope(volume, pressure))
        secant = stiffness.secant(pressure, volume(pressure), 0.0, 1.0)
        assert secant == pytest.approx(e_0 + m * pressure, rel=1e-6)
        assert stiffness.tangent_from_secant(e_0 + m * pressure, pressure, m) == pytest.approx(expected, rel=1e-6)


def test_a_tube_widens_as_Lame_says() -> None:
    outer, inner, poisson, young, p = 0.016, 0.012, 0.3, 2.1e11, 1e7
    ratio = (outer / inner) ** 2
    radial, hoop, axial = -p, p * (ratio + 1.0) / (ratio - 1.0), p / (ratio - 1.0)  # closed ends, at the bore
    growth = 2.0 * (hoop - poisson * (radial + axial)) / young + (axial - poisson * (radial + hoop)) / young
    w = stiffness.thick_wall(outer, inner, poisson)
    assert w * p / young == pytest.approx(growth, rel=1e-12)
    oil = 1.5e9
    assert stiffness.effective_modulus(oil, young, w) == pytest.approx(1.0 / (1.0 / oil + growth / p), rel=1e-12)


def test_a_thin_wall_is_the_limit_of_a_thick_one_within_its_five_per_cent() -> None:
    inner, wall = 0.1, 1e-5
    thick = stiffness.thick_wall(inner + 2.0 * wall, inner, 0.3)
    assert thick / stiffness.thin_wall(inner, wall) == pytest.approx((5.0 - 4.0 * 0.3) / 4.0, rel=1e-3)


def test_oil_spring_is_the_force_of_trapped_oil_per_displacement() -> None:
    e, a_1, v_1, a_2, v_2 = 1.2e9, 1e-3, 2e-4, 0.8e-3, 1.5e-4
    move = 1e-7
    force = a_1 * e * math.log(v_1 / (v_1 - a_1 * move)) - a_2 * e * math.log(v_2 / (v_2 + a_2 * move))
    assert stiffness.stiffness(e, a_1, v_1, a_2, v_2) == pytest.approx(force / move, rel=1e-5)


def test_oil_spring_is_softest_in_the_middle_for_equal_areas() -> None:
    total, area = 2.4586e-4, 9.4562e-4
    softest = stiffness.softest_volume(area, area, total)
    assert softest == pytest.approx(0.5 * total)
    volumes = np.linspace(0.1, 0.9, 81) * total
    stiff = [stiffness.stiffness_of_total(1e9, area, v, 0.7 * area, total) for v in volumes]
    assert volumes[np.argmin(stiff)] == pytest.approx(
        stiffness.softest_volume(area, 0.7 * area, total), abs=0.01 * total
    )


def test_twice_the_mass_swings_slower_by_the_root_of_two() -> None:
    assert stiffness.natural_frequency(1e7, 1000.0) == 100.0
    assert stiffness.natural_frequency(1e7, 500.0) == pytest.approx(141.42, rel=1e-4)


def test_soft_zone_has_the_values_of_table_6_9() -> None:
    # λ_1 = 1.2868, λ_2 = 0.5401, μ = 8.80e-6, P_Lt = 9.177e5: h = 0.21 inside, 1.29 outside
    depth = 2.0 * 0.5401 / 1.2868 * math.tanh(8.8e-6 * 9.177e5)
    inside, outside = (1.2868 * soft_zone(p, depth, 9.177e5, 8.8e-6) for p in (0.0, 40e5))
    assert inside == pytest.approx(0.21, abs=0.005)
    assert outside == pytest.approx(1.29, abs=0.005)
    printed = 1.2868 - 0.5401 * (math.tanh(8.8e-6 * (5e5 + 9.177e5)) - math.tanh(8.8e-6 * (5e5 - 9.177e5)))
    assert 1.2868 * soft_zone(5e5, depth, 9.177e5, 8.8e-6) == pytest.approx(printed, rel=1e-9)
