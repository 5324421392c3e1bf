"""Bulk modulus of a liquid with entrained air after IFAS, (2.32); its limits are the simpler laws.

The tangent bulk modulus of a mixture of liquid (modulus E_0 at P_0, rising by m per unit of pressure, (2.28))
and a volume fraction α of air (polytropic exponent κ):

    V(P) = (1−α) (1 + m (P−P_0)/E_0)^(−1/m) + α r^(1/κ),  r = P_0/P
    E(P) = −V / (dV/dP)

α = 0 gives E_0 + m (P−P_0) exactly; m = 0 as well gives the constant E_0. Valid for P > 0 and
1 + m (P−P_0)/E_0 > 0; both are held from below (pressure at 1 kPa) so that a cavitating chamber stays finite.

Source: thesis, (2.32), with the equation sheet's square and sign conventions. Verified against a numerical
derivative of V(P).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus.law import LiquidWithAir
from shake_ros.quantities import quantity

LOWEST_PRESSURE = 1.0e3  # [Pa] the laws of mixture are not evaluated below this


@dataclass(frozen=True, kw_only=True)
class Ifas(LiquidWithAir):
    """Parameters of (2.32)."""

    code: ClassVar[int] = 5
    stiffness: ClassVar[tuple[str, ...]] = ("modulus", "slope")

    modulus: float = quantity("Pa", "bulk modulus E_0 of the liquid at P_0", low=1e6, high=1e11)
    slope: float = quantity("-", "rise of the liquid's modulus per pressure m", low=0.0, high=300.0)


@njit
def relative_volume(pressure, e_0, m, alpha, kappa, p_0):
    """Volume of the mixture relative to the one at P_0 (2.32) [-]."""
    p = max(pressure, LOWEST_PRESSURE)
    liquid = (1.0 + m * (p - p_0) / e_0) ** (-1.0 / m) if m > 1e-9 else math.exp(-(p - p_0) / e_0)
    return (1.0 - alpha) * liquid + alpha * (p_0 / p) ** (1.0 / kappa)


@njit
def mixture(pressure, e_0, m, alpha, kappa, p_0):
    """Tangent bulk modulus of the mixture (2.32) [Pa]."""
    p = max(pressure, LOWEST_PRESSURE)
    liquid_modulus = max(e_0 + m * (p - p_0), 1e-2 * e_0)  # (2.28)
    if alpha <= 0.0:
        return liquid_modulus
    liquid = (liquid_modulus / e_0) ** (-1.0 / m) if m > 1e-9 else math.exp(-(p - p_0) / e_0)
    air = alpha * (p_0 / p) ** (1.0 / kappa)
    volume = (1.0 - alpha) * liquid + air
    slope = (1.0 - alpha) * liquid / liquid_modulus + air / (kappa * p)  # −dV/dP
    return volume / slope


@njit
def bulk_modulus(p, pressure):
    """The mixture's modulus with the law's own numbers [Pa]."""
    e_0, m, alpha = p.bulk_modulus_modulus, p.bulk_modulus_slope, p.bulk_modulus_fraction
    return mixture(pressure, e_0, m, alpha, p.bulk_modulus_polytropic_exponent, p.bulk_modulus_reference_pressure)
