"""The liquid stiffens in proportion to the pressure, (2.28): Ē = E_0 + m P.

Range: pure mineral oil up to some hundred bar, m about 8 … 12. Source: thesis, section 2.4.1. Verified by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.bulk_modulus.law import LawWithoutAir
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class Linear(LawWithoutAir):
    """Parameters of (2.28)."""

    code: ClassVar[int] = 1
    stiffness: ClassVar[tuple[str, ...]] = ("modulus", "slope")

    modulus: float = quantity("Pa", "bulk modulus E_0 at zero pressure", low=1e6, high=1e11)
    slope: float = quantity("-", "rise of the modulus per pressure m", low=0.0, high=300.0)


@njit
def bulk_modulus(p, pressure):
    """Ē = E_0 + m P [Pa]."""
    return p.bulk_modulus_modulus + p.bulk_modulus_slope * pressure  # (2.28)
