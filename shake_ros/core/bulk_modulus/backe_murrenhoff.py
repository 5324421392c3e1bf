"""Bulk modulus of liquid and air after Backé and Murrenhoff, (2.31).

    E = Ē (1 + α) / (1 + (P_0/P)^(1/κ) α Ē/(κ P))

α is the volume of air per volume of liquid at P_0; the whole volume is taken as constant, 1 + α.
Range: small α, P > 0, Ē constant. Source: thesis, section 2.4.1. Verified against a numerical derivative of the volume.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.bulk_modulus.law import BulkModulusLaw
from shake_ros.core.compiled import njit
from shake_ros.core.quantities import quantity

CODE = 4


@dataclass(frozen=True)
class BackeMurrenhoff(BulkModulusLaw):
    """Parameters of (2.31)."""

    code: ClassVar[int] = CODE

    modulus: float = quantity("Pa", "bulk modulus Ē of the liquid without air", low=1e6, high=1e11)
    fraction: float = quantity("-", "volume fraction α of free air at P_0", low=0.0, high=0.3)
    polytropic_exponent: float = quantity("-", "polytropic exponent κ of the air", low=0.3, high=2.0)
    reference_pressure: float = quantity("Pa", "initial pressure P_0", low=1e3, high=1e7)


@njit
def bulk_modulus(p, pressure):
    """Bulk modulus of the mixture (2.31) [Pa]."""
    e_liquid, alpha = p.bulk_modulus_modulus, p.bulk_modulus_fraction
    kappa, p_0 = p.bulk_modulus_polytropic_exponent, p.bulk_modulus_reference_pressure
    air = (p_0 / pressure) ** (1.0 / kappa) * alpha * e_liquid / (kappa * pressure)
    return e_liquid * (1.0 + alpha) / (1.0 + air)  # (2.31)
