"""Stiffness of oil: the bulk moduli of a liquid, oil shut into a cylinder, oil in a pipe that widens.

The four bulk moduli of a liquid, isothermal or adiabatic, secant or tangent, and how one follows from another.

Secant moduli relate the whole change of volume since P_0 to the initial volume, (2.12), (2.14); tangent moduli relate
its slope at P to the volume there, (2.13), (2.15). Isothermal or adiabatic is a matter of the P–V curve they are taken
from, so each pair is one function. Source: thesis, section 2.3; Hayward's relation (2.16) for a secant modulus that
rises linearly with pressure. Verified against table 2.2 (20 °C, 50 MPa) and a numerical derivative.

Oil shut into a cylinder is a spring, and the moved mass swings on it, (2.22)–(2.27), (2.36).

    k = E (A_1²/V_1 + A_2²/V_2),  ω = sqrt(k/M)

Over a constant total volume k is least where A_1/V_1 = A_2/V_2: for equal areas in the middle of the stroke.
(2.36) is printed for kgf, with W/g in place of M; SI is used here.
Source: thesis, sections 2.3.1, 2.4.3. Verified against finite compression and the poles of the linearised plant.

A pipe that widens under pressure lowers the bulk modulus of the oil in it, (2.33)–(2.35).

E_p, called the pipeline's bulk modulus in print, is Young's modulus of the wall: w p/E_p is the relative growth of the
bore of a closed tube after Lamé. Range: elastic walls; thin where s/d_o < 0.1. The thin-wall w = d_i/s leaves out that
the wall is held along its axis and is 5 % above the thick-wall value at ν = 0.3.
Source: thesis, section 2.4.2. Verified against Lamé's stresses.
"""

from __future__ import annotations

import math

from shake_ros.compiled import njit


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


@njit
def stiffness(bulk_modulus, area_1, volume_1, area_2, volume_2):
    """k of two trapped volumes (2.25) [N/m]."""
    return bulk_modulus * (area_1 * area_1 / volume_1 + area_2 * area_2 / volume_2)  # (2.25)


@njit
def stiffness_of_total(bulk_modulus, area_1, volume_1, area_2, total_volume):
    """k with the second volume as the rest of a total V_T (2.26) [N/m]."""
    return stiffness(bulk_modulus, area_1, volume_1, area_2, total_volume - volume_1)  # (2.26)


@njit
def softest_volume(area_1, area_2, total_volume):
    """V_1 at which k of (2.26) is least, dk/dV_1 = 0 at a constant V_T [m³].

    (2.27) prints A_1²/V_1 = A_2²/V_2; the derivative of (2.26) gives A_1/V_1 = A_2/V_2. Equal areas satisfy both.
    """
    return total_volume * area_1 / (area_1 + area_2)  # (2.27)


@njit
def natural_frequency(stiffness, mass):
    """ω = sqrt(k/M) (2.36) [rad/s]."""
    return math.sqrt(stiffness / mass)  # (2.36)


@njit
def effective_modulus(oil_modulus, wall_modulus, w):
    """E = Ē/(1 + w Ē/E_p) (2.33) [Pa]."""
    return oil_modulus / (1.0 + oil_modulus / wall_modulus * w)  # (2.33)


@njit
def thick_wall(outer_diameter, inner_diameter, poisson):
    """w of a thick-walled pipe (2.34) [-]."""
    ratio = (outer_diameter / inner_diameter) ** 2
    return (2.0 * ratio * (1.0 + poisson) + 3.0 * (1.0 - 2.0 * poisson)) / (ratio - 1.0)  # (2.34)


@njit
def thin_wall(inner_diameter, wall_thickness):
    """w of a thin-walled pipe (2.35) [-]."""
    return inner_diameter / wall_thickness  # (2.35)
