"""Liquid and air as springs in series, after Wylie, with Kajaste's polytropic air, (2.29).

    E = Ē / [1 + α (P_0/P)^(1/κ) (Ē/(κ P) − 1)]

The air fills the part x = α (P_0/P)^(1/κ) of the volume: 1/E = (1 − x)/Ē + x/(κ P). Range: x ≪ 1, P > 0, Ē constant.
Source: thesis, section 2.4.1. Verified against the sum of the two compliances.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.bulk_modulus.law import BulkModulusLaw
from shake_ros.core.compiled import njit
from shake_ros.core.quantities import quantity

CODE = 2


@dataclass(frozen=True)
class WylieKajaste(BulkModulusLaw):
    """Parameters of (2.29)."""

    code: ClassVar[int] = CODE

    modulus: float = quantity("Pa", "bulk modulus Ē of the liquid without air", low=1e6, high=1e11)
    fraction: float = quantity("-", "volume fraction α of free air at P_0", low=0.0, high=0.3)
    polytropic_exponent: float = quantity("-", "polytropic exponent κ of the air", low=0.3, high=2.0)
    reference_pressure: float = quantity("Pa", "initial pressure P_0", low=1e3, high=1e7)


@njit
def bulk_modulus(p, pressure):
    """Bulk modulus of the mixture (2.29) [Pa]."""
    e_liquid, alpha = p.bulk_modulus_modulus, p.bulk_modulus_fraction
    kappa, p_0 = p.bulk_modulus_polytropic_exponent, p.bulk_modulus_reference_pressure
    share = alpha * (p_0 / pressure) ** (1.0 / kappa)
    return e_liquid / (1.0 + share * (e_liquid / (kappa * pressure) - 1.0))  # (2.29)
