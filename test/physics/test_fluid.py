"""Fluid laws against hand values, limits, numerical integrals and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from shake_ros.physics import fluid
from shake_ros.physics.fluid import Oil
from shake_ros.quantities import ShakeError
from shake_ros.settings import find, read_yaml

HLP_32 = Oil.from_mapping(read_yaml(find("fluid", "hlp_32")), "hlp_32")
PIPE = {"length": 2.0, "diameter": 0.012, "viscosity": 0.03, "density": 850.0}


def test_viscosity_falls_by_the_same_factor_with_every_degree() -> None:
    warm = fluid.viscosity_at_temperature(0.04, 0.05, 300.0 + 1.0 / 0.05, 300.0)
    assert warm == pytest.approx(0.04 / math.e)
    temperatures = np.array([290.0, 300.0, 310.0])
    eta = fluid.viscosity_at_temperature(0.04, 0.05, temperatures, 300.0)
    assert eta[0] / eta[1] == pytest.approx(eta[1] / eta[2])


def test_viscosity_doubles_at_the_pressure_that_table_2_1_says() -> None:
    # 20 °C: α = 2.595e-8 1/Pa, so ln 2 / α = 267 bar; with the printed power of ten it would be 27 Pa
    alpha = fluid.viscosity_coefficient(293.15, np.array(HLP_32.temperatures), np.array(HLP_32.coefficients))
    assert alpha == pytest.approx(2.595e-8)
    doubling = brentq(lambda p: fluid.viscosity_at_pressure(1.0, alpha, p) - 2.0, 1e5, 1e9)
    assert doubling == pytest.approx(267e5, rel=0.01)


def test_coefficient_is_linear_between_rows_and_held_beyond_them() -> None:
    rows = np.array(HLP_32.temperatures), np.array(HLP_32.coefficients)
    assert fluid.viscosity_coefficient(298.15, *rows) == pytest.approx(0.5 * (2.595e-8 + 2.339e-8))
    assert fluid.viscosity_coefficient(200.0, *rows) == 3.268e-8
    assert fluid.viscosity_coefficient(500.0, *rows) == 1.283e-8


def test_the_oil_has_its_viscosity_grade_at_40_degrees() -> None:
    eta = HLP_32.viscosity(313.15, 0.0)
    assert fluid.kinematic(eta, 850.0) * 1e6 == pytest.approx(32.0, rel=1e-6)  # mm²/s
    assert HLP_32.viscosity(313.15, 200e5) > 1.4 * eta


def test_density_by_hand_and_the_two_families_agree_to_second_order() -> None:
    assert fluid.density_at_temperature(850.0, 0.65e-3, 340.0, 290.0) == pytest.approx(850.0 / 1.0325)
    assert fluid.density_at_pressure(850.0, 0.7e-9, 201e5, 1e5) == pytest.approx(850.0 / (1.0 - 0.014))
    assert fluid.density_at_constant_temperature(850.0, 1.7e9, 17e6) == pytest.approx(858.5)
    modulus = 1.0 / 0.7e-9
    assert fluid.compressibility(modulus) == pytest.approx(0.7e-9)
    for pressure, temperature in ((1e5, 290.0), (200e5, 290.0), (1e5, 320.0), (200e5, 320.0)):
        one = fluid.linearised_density(850.0, modulus, 0.65e-3, pressure, temperature, 1e5, 290.0)
        other = fluid.density_at_both(850.0, 0.65e-3, 0.7e-9, pressure, temperature, 1e5, 290.0)
        assert one == pytest.approx(other, rel=1e-3)
    assert HLP_32.density(288.15, 1e5) == 850.0


def test_laminar_flow_is_the_integral_of_its_profile() -> None:
    radius, gradient, eta = 0.005, -3e4, 0.03
    flow, _ = quad(lambda r: 2.0 * math.pi * r * fluid.velocity_profile(r, radius, eta, gradient), 0.0, radius)
    assert fluid.laminar_flow(3e4, 1.0, 0.01, eta) == pytest.approx(flow, rel=1e-10)
    assert fluid.mean_velocity(radius, eta, gradient) == pytest.approx(flow / (math.pi * radius**2), rel=1e-10)
    middle = fluid.velocity_profile(0.0, radius, eta, gradient)
    assert middle == pytest.approx(2.0 * fluid.mean_velocity(radius, eta, gradient))  # (2.68)


def test_slow_flow_loses_pressure_as_Hagen_and_Poiseuille_say() -> None:
    drop = fluid.pressure_drop(1e-4, **PIPE)
    assert fluid.reynolds(1e-4 / (math.pi * 0.006**2), 0.012, 0.03, 850.0) < 2000.0
    assert fluid.laminar_flow(drop, 2.0, 0.012, 0.03) == pytest.approx(1e-4, rel=1e-12)


def test_friction_factor_is_continuous_and_has_the_published_ends() -> None:
    assert fluid.friction_factor(1000.0) == 0.064
    assert fluid.friction_factor(1e4) == pytest.approx(0.03164)
    for corner in (2000.0, 4000.0):
        below, above = (fluid.friction_factor(corner * (1.0 + e)) for e in (-1e-9, 1e-9))
        assert below == pytest.approx(above, rel=1e-6)


def test_pressure_drop_rises_with_the_flow_through_the_transition_and_is_odd() -> None:
    flows = np.linspace(1e-5, 5e-3, 4000)
    drops = np.array([fluid.pressure_drop(q, **PIPE) for q in flows])
    assert np.all(np.diff(drops) > 0.0)
    assert fluid.pressure_drop(-1e-3, **PIPE) == -fluid.pressure_drop(1e-3, **PIPE)
    assert fluid.pressure_drop(0.0, **PIPE) == 0.0


@pytest.mark.parametrize("wanted", [1e-6, 3e-4, 7e-4, 9e-4, 1.2e-3, 4e-3, -1e-3])
def test_flow_is_the_inverse_of_the_pressure_drop(wanted: float) -> None:
    assert fluid.pipe_flow(fluid.pressure_drop(wanted, **PIPE), **PIPE) == pytest.approx(wanted, rel=1e-9)


def test_a_square_duct_is_as_wide_as_its_side() -> None:
    assert fluid.hydraulic_diameter(0.02**2, 4 * 0.02) == pytest.approx(0.02)


def test_pressure_rises_with_what_flows_in_and_is_not_given_way() -> None:
    assert fluid.pressure_rate(1e9, 1e-3, 1e-4, 0.0) == pytest.approx(1e8)
    assert fluid.pressure_rate(1e9, 1e-3, 1e-4, 1e-4) == 0.0


def test_a_sharp_edge_passes_61_per_cent() -> None:
    assert pytest.approx(0.611, abs=5e-4) == fluid.SHARP_EDGE


def test_orifice_is_turbulent_at_high_and_laminar_at_low_pressure() -> None:
    k_2 = 1.0 / fluid.SHARP_EDGE**2
    numbers = {"diameter": 1e-3, "viscosity": 0.03, "density": 850.0, "k_1": 150.0, "k_2": k_2}
    turbulent = fluid.orifice_turbulent_flow(500e5, fluid.area(1e-3), 850.0, fluid.SHARP_EDGE)
    assert fluid.orifice_flow(500e5, **{**numbers, "viscosity": 1e-5}) == pytest.approx(turbulent, rel=2e-3)
    assert fluid.orifice_flow(2.0, **numbers) == pytest.approx(2.0 * fluid.orifice_flow(1.0, **numbers), rel=1e-4)
    laminar = fluid.area(1e-3) * 2.0 * 1e-3 / (150.0 * 0.03)  # Δp = ρ/2 k_1 ν/d v at 1 Pa
    assert fluid.orifice_flow(1.0, **numbers) == pytest.approx(laminar, rel=1e-4)
    assert fluid.orifice_flow(-1e5, **numbers) == -fluid.orifice_flow(1e5, **numbers)
    assert fluid.orifice_flow(0.0, **numbers) == 0.0


@pytest.mark.parametrize("drop", [1e3, 1e5, 5e6])
def test_orifice_flow_leaves_no_residual_in_the_loss_equation(drop: float) -> None:
    d, eta, rho, k_1, k_2 = 1e-3, 0.03, 850.0, 150.0, 2.68
    velocity = fluid.orifice_flow(drop, d, eta, rho, k_1, k_2) / fluid.area(d)
    factor = fluid.loss_factor(fluid.reynolds(velocity, d, eta, rho), k_1, k_2)
    assert fluid.orifice_loss(factor, velocity, rho) == pytest.approx(drop, rel=1e-9)


def test_Bernoulli_loses_nothing_in_a_fall_without_friction() -> None:
    height = 3.0
    velocity = math.sqrt(2.0 * 9.80665 * height)
    assert fluid.energy_loss(1e5, 0.0, 1e5, velocity, 850.0, height) == pytest.approx(0.0, abs=1e-6)
    assert fluid.energy_loss(3e5, 2.0, 1e5, 2.0, 850.0, 0.0) == pytest.approx(2e5)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ([], "expected oil, pressure_viscosity"),
        ({"oil": {}, "pressure_viscosity": {}}, "expected lists"),
        ({"oil": {}, "pressure_viscosity": {"temperature": [2.0, 1.0], "coefficient": [1.0, 1.0]}}, "rising"),
        ({"oil": {}, "pressure_viscosity": {"temperature": [1.0], "coefficient": [1e-8]}}, "missing density"),
    ],
)
def test_a_wrong_oil_is_refused(content: object, said: str) -> None:
    with pytest.raises(ShakeError, match=said):
        Oil.from_mapping(content, "here")  # type: ignore[arg-type]
