"""Density of the fluid against pressure and temperature, (2.7), (2.9), (2.18)–(2.21).

Two families of formulas: the linearised equation of state about a point, (2.7) with its special case (2.9), and the
expressions of data sheets with a heat expansion factor β_T and a compressibility κ_P, (2.18), (2.19), (2.21).
κ_P (2.20) is the inverse of the isothermal bulk modulus. Range: a liquid, |ρ/ρ_0 − 1| of a few per cent, where both
agree to second order. Source: thesis, section 2.3. Verified against each other and by hand.
"""

from __future__ import annotations

from shake_ros.core.compiled import njit


@njit
def linearised(rho_0, bulk_modulus, expansion, pressure, temperature, reference_pressure, reference_temperature):
    """Equation of state linearised about (P_0, T_0) (2.7) [kg/m³]."""
    strain = (pressure - reference_pressure) / bulk_modulus - expansion * (temperature - reference_temperature)
    return rho_0 * (1.0 + strain)  # (2.7)


@njit
def at_constant_temperature(rho_0, bulk_modulus, pressure):
    """Density at a pressure above the one of ρ_0, temperature as there (2.9) [kg/m³]."""
    return rho_0 + rho_0 / bulk_modulus * pressure  # (2.9)


@njit
def at_temperature(rho_0, expansion, temperature, reference_temperature):
    """Density at atmospheric pressure (2.18) [kg/m³].

    >>> round(float(at_temperature(850.0, 0.65e-3, 315.0, 290.0)), 3)
    836.408
    """
    return rho_0 / (1.0 + expansion * (temperature - reference_temperature))  # (2.18)


@njit
def at_pressure(rho_0, compressibility, pressure, reference_pressure):
    """Density at the reference temperature (2.19) [kg/m³]."""
    return rho_0 / (1.0 - compressibility * (pressure - reference_pressure))  # (2.19)


@njit
def compressibility(bulk_modulus):
    """κ_P = (1/V_0)(∂V/∂P)_T without its sign: the inverse of the isothermal bulk modulus (2.20) [1/Pa]."""
    return 1.0 / bulk_modulus  # (2.20)


@njit
def at_pressure_and_temperature(
    rho_0, expansion, compressibility, pressure, temperature, reference_pressure, reference_temperature
):
    """Density from both data-sheet factors (2.21) [kg/m³]."""
    rho_t = at_temperature(rho_0, expansion, temperature, reference_temperature)
    return rho_t * (1.0 + compressibility * (pressure - reference_pressure))  # (2.21)
