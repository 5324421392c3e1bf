"""Bulk modulus of liquid and air after Nykänen, (2.30).

    V(P) = α r^(1/κ) + (1−α) / (1 + (P−P_0)/Ē),  r = P_0/P
    E(P) = V² / [α r^(1/κ)/(κ P) + (1−α) / (Ē (1 + (P−P_0)/Ē)²)] = V² / (−dV/dP)

The square keeps a liquid without air at Ē: its volume belongs to a density that is linear in pressure.
Range: P > 0, Ē constant. Source: thesis, section 2.4.1. Verified against a numerical derivative of V(P).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus.law import LiquidWithAir


@dataclass(frozen=True, kw_only=True)
class Nykanen(LiquidWithAir):
    """Parameters of (2.30)."""

    code: ClassVar[int] = 3


@njit
def relative_volume(pressure, e_liquid, alpha, kappa, p_0):
    """Volume of the mixture relative to the one at P_0 (2.30) [-]."""
    return alpha * (p_0 / pressure) ** (1.0 / kappa) + (1.0 - alpha) / (1.0 + (pressure - p_0) / e_liquid)


@njit
def bulk_modulus(p, pressure):
    """Bulk modulus of the mixture (2.30) [Pa]."""
    e_liquid, alpha = p.bulk_modulus_modulus, p.bulk_modulus_fraction
    kappa, p_0 = p.bulk_modulus_polytropic_exponent, p.bulk_modulus_reference_pressure
    air = alpha * (p_0 / pressure) ** (1.0 / kappa) / (kappa * pressure)
    liquid = (1.0 - alpha) / (e_liquid * (1.0 + (pressure - p_0) / e_liquid) ** 2)
    return relative_volume(pressure, e_liquid, alpha, kappa, p_0) ** 2 / (air + liquid)  # (2.30)
