"""The four bulk moduli of a liquid, isothermal or adiabatic, secant or tangent, and how one follows from another.

Secant moduli relate the whole change of volume since P_0 to the initial volume, (2.12), (2.14); tangent moduli relate
its slope at P to the volume there, (2.13), (2.15). Isothermal or adiabatic is a matter of the P–V curve they are taken
from, so each pair is one function. Source: thesis, section 2.3; Hayward's relation (2.16) for a secant modulus that
rises linearly with pressure. Verified against table 2.2 (20 °C, 50 MPa) and a numerical derivative.
"""

from __future__ import annotations

from shake_ros.core.compiled import njit


@njit
def secant(pressure, volume, initial_pressure, initial_volume):
    """Ē = −V_0 (P − P_0)/(V − V_0), along an isotherm (2.12) or an adiabat (2.14) [Pa].

    >>> round(float(secant(21.0, 0.98, 1.0, 1.0)), 6)
    1000.0
    """
    return -initial_volume * (pressure - initial_pressure) / (volume - initial_volume)  # (2.12), (2.14)


@njit
def tangent(volume, slope):
    """E = −V ∂P/∂V with the slope ∂P/∂V [Pa/m³] of an isotherm (2.13) or an adiabat (2.15) [Pa]."""
    return -volume * slope  # (2.13), (2.15)


@njit
def tangent_from_secant(secant_modulus, pressure, slope):
    """Tangent modulus from the secant modulus Ē and its slope dĒ/dP at the pressure above P_0 (2.16) [Pa]."""
    return secant_modulus * (secant_modulus - pressure) / (secant_modulus - pressure * slope)  # (2.16)


@njit
def adiabatic_from_isothermal(isothermal_modulus, heat_capacity_ratio):
    """E_S = E_T C_p/C_v (2.17) [Pa]."""
    return isothermal_modulus * heat_capacity_ratio  # (2.17)
