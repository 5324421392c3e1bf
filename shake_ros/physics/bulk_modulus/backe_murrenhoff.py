"""Bulk modulus of liquid and air after Backé and Murrenhoff, (2.31).

    E = Ē (1 + α) / (1 + (P_0/P)^(1/κ) α Ē/(κ P))

α is the volume of air per volume of liquid at P_0; the whole volume is taken as constant, 1 + α.
Range: small α, P > 0, Ē constant. Source: thesis, section 2.4.1. Verified against a numerical derivative of the volume.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus.law import LiquidWithAir


@dataclass(frozen=True, kw_only=True)
class BackeMurrenhoff(LiquidWithAir):
    """Parameters of (2.31)."""

    code: ClassVar[int] = 4


@njit
def bulk_modulus(p, pressure):
    """Bulk modulus of the mixture (2.31) [Pa]."""
    e_liquid, alpha = p.bulk_modulus_modulus, p.bulk_modulus_fraction
    kappa, p_0 = p.bulk_modulus_polytropic_exponent, p.bulk_modulus_reference_pressure
    air = (p_0 / pressure) ** (1.0 / kappa) * alpha * e_liquid / (kappa * pressure)
    return e_liquid * (1.0 + alpha) / (1.0 + air)  # (2.31)
