"""The same bulk modulus at every pressure: the `none` of this family, and the law of a table that names none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.bulk_modulus.law import BulkModulusLaw
from shake_ros.core.compiled import njit
from shake_ros.core.quantities import quantity

CODE = 0


@dataclass(frozen=True)
class Constant(BulkModulusLaw):
    """E does not depend on the pressure."""

    code: ClassVar[int] = CODE

    modulus: float = quantity("Pa", "bulk modulus E (θ_5 V_t/2)", low=1e6, high=1e11, live=True)
    reference_pressure: float = quantity("Pa", "pressure P_0 at which E holds", low=0.0, high=1e8)


@njit
def bulk_modulus(p, pressure):
    """E at any pressure [Pa]."""
    return p.bulk_modulus_modulus
