"""Empirical bulk modulus after Hoffmann, (2.38).

    E = E_max [1 − exp(−0.4 − 2e-7 P)]

It includes entrained air and the walls. Range: some hundred bar. The thesis gives no E_max; 18000 bar as for Lee's law
is configured. Source: thesis, section 2.4.4. Verified by hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus.law import LawWithoutAir
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class Hoffmann(LawWithoutAir):
    """Parameters of (2.38)."""

    code: ClassVar[int] = 7
    stiffness: ClassVar[tuple[str, ...]] = ("largest_modulus",)

    largest_modulus: float = quantity("Pa", "E_max", low=1e6, high=1e11)
    offset: float = quantity("-", "exponent at zero pressure", low=0.0, high=10.0)
    rate: float = quantity("1/Pa", "rise of the exponent per pressure", low=0.0, high=1e-3)


@njit
def bulk_modulus(p, pressure):
    """E(P) of (2.38) [Pa]."""
    left = math.exp(-p.bulk_modulus_offset - p.bulk_modulus_rate * pressure)
    return p.bulk_modulus_largest_modulus * (1.0 - left)  # (2.38)
