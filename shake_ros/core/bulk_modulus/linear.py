"""The liquid stiffens in proportion to the pressure, (2.28): Ē = E_0 + m P.

Range: pure mineral oil up to some hundred bar, m about 8 … 12. Source: thesis, section 2.4.1. Verified by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.bulk_modulus.law import BulkModulusLaw
from shake_ros.core.compiled import njit
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class Linear(BulkModulusLaw):
    """Parameters of (2.28)."""

    modulus: float = quantity("Pa", "bulk modulus E_0 at zero pressure", low=1e6, high=1e11)
    slope: float = quantity("-", "rise of the modulus per pressure m", low=0.0, high=300.0)

    def at(self, pressure: np.ndarray) -> np.ndarray:
        return np.asarray(bulk_modulus(np.asarray(pressure, dtype=float), self.modulus, self.slope))


@njit
def bulk_modulus(pressure, e_0, m):
    """Ē = E_0 + m P (2.28) [Pa].

    >>> float(bulk_modulus(100e5, 1.2e9, 10.0))
    1300000000.0
    """
    return e_0 + m * pressure  # (2.28)
