"""Empirical bulk modulus after Eggerth, (2.39), with his parameters at 20, 50 and 90 °C, table 2.3.

    E = 1 / [k_1 + k_2 (P/P_0)^(−λ)],  P_0 = 10 bar

It includes entrained air and the walls. Range: P > 0, 20 … 90 °C. Source: thesis, section 2.4.4. Verified by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus.law import BulkModulusLaw
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class Eggerth(BulkModulusLaw):
    """Parameters of (2.39), one row of table 2.3."""

    code: ClassVar[int] = 8
    stiffness: ClassVar[tuple[str, ...]] = ()
    compliance: ClassVar[tuple[str, ...]] = ("k1", "k2")

    k1: float = quantity("1/Pa", "compressibility k_1 at high pressure", low=1e-12, high=1e-6)
    k2: float = quantity("1/Pa", "compressibility k_2 that vanishes with pressure", low=0.0, high=1e-6)
    exponent: float = quantity("-", "exponent λ", low=0.0, high=5.0)
    reference_pressure: float = quantity("Pa", "pressure P_0", low=1e3, high=1e8)


@njit
def bulk_modulus(p, pressure):
    """E(P) [Pa]."""
    relative = pressure / p.bulk_modulus_reference_pressure
    return 1.0 / (p.bulk_modulus_k1 + p.bulk_modulus_k2 * relative ** (-p.bulk_modulus_exponent))  # (2.39)
