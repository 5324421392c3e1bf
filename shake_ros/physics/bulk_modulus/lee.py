"""Empirical bulk modulus of hydraulic cylinders after Lee, (2.37), common in German literature.

    E = a_1 E_max log10(a_2 P/P_max + a_3),  a_1 = 0.5, a_2 = 90, a_3 = 3, E_max = 18000 bar, P_max = 280 bar

It includes entrained air and the walls. Range: 0 … P_max. Source: thesis, section 2.4.4. Verified by hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus.law import LawWithoutAir
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class Lee(LawWithoutAir):
    """Parameters of (2.37)."""

    code: ClassVar[int] = 6
    stiffness: ClassVar[tuple[str, ...]] = ("largest_modulus",)

    largest_modulus: float = quantity("Pa", "E_max", low=1e6, high=1e11)
    largest_pressure: float = quantity("Pa", "P_max", low=1e5, high=1e9)
    a1: float = quantity("-", "factor a_1", low=0.0, high=10.0)
    a2: float = quantity("-", "factor a_2", low=0.0, high=1e4)
    a3: float = quantity("-", "summand a_3", low=1.0, high=1e3)


@njit
def bulk_modulus(p, pressure):
    """E(P) of (2.37), decimal logarithm [Pa]."""
    relative = pressure / p.bulk_modulus_largest_pressure
    rise = math.log10(p.bulk_modulus_a2 * relative + p.bulk_modulus_a3)
    return p.bulk_modulus_a1 * p.bulk_modulus_largest_modulus * rise  # (2.37)
