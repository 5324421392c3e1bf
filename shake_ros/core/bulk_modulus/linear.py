"""The liquid stiffens in proportion to the pressure, (2.28): Ē = E_0 + m P.

Range: pure mineral oil up to some hundred bar, m about 8 … 12. Source: thesis, section 2.4.1. Verified by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.bulk_modulus.law import STANDARD_PRESSURE, BulkModulusLaw
from shake_ros.core.compiled import njit
from shake_ros.core.quantities import quantity

CODE = 1


@dataclass(frozen=True)
class Linear(BulkModulusLaw):
    """Parameters of (2.28)."""

    code: ClassVar[int] = CODE
    stiffness: ClassVar[tuple[str, ...]] = ("modulus", "slope")

    modulus: float = quantity("Pa", "bulk modulus E_0 at zero pressure", low=1e6, high=1e11)
    slope: float = quantity("-", "rise of the modulus per pressure m", low=0.0, high=300.0)
    reference_pressure: float = quantity(
        "Pa", "pressure P_0 at which an effect counts free air", low=0.0, high=1e8, default=STANDARD_PRESSURE
    )


@njit
def bulk_modulus(p, pressure):
    """Ē = E_0 + m P [Pa]."""
    return p.bulk_modulus_modulus + p.bulk_modulus_slope * pressure  # (2.28)
