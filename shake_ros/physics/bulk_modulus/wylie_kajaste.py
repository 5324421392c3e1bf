"""Liquid and air as springs in series, after Wylie, with Kajaste's polytropic air, (2.29).

    E = Ē / [1 + α (P_0/P)^(1/κ) (Ē/(κ P) − 1)]

The air fills the part x = α (P_0/P)^(1/κ) of the volume: 1/E = (1 − x)/Ē + x/(κ P). Range: x ≪ 1, P > 0, Ē constant.
Source: thesis, section 2.4.1. Verified against the sum of the two compliances.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus.law import LiquidWithAir


@dataclass(frozen=True, kw_only=True)
class WylieKajaste(LiquidWithAir):
    """Parameters of (2.29)."""

    code: ClassVar[int] = 2


@njit
def bulk_modulus(p, pressure):
    """Bulk modulus of the mixture (2.29) [Pa]."""
    e_liquid, alpha = p.bulk_modulus_modulus, p.bulk_modulus_fraction
    kappa, p_0 = p.bulk_modulus_polytropic_exponent, p.bulk_modulus_reference_pressure
    share = alpha * (p_0 / pressure) ** (1.0 / kappa)
    return e_liquid / (1.0 + share * (e_liquid / (kappa * pressure) - 1.0))  # (2.29)
