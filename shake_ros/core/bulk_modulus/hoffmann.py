"""Empirical bulk modulus after Hoffmann, (2.38).

    E = E_max [1 − exp(−0.4 − 2e-7 P)]

It includes entrained air and the walls. Range: some hundred bar. The thesis gives no E_max; 18000 bar as for Lee's law
is configured. Source: thesis, section 2.4.4. Verified by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.bulk_modulus.law import BulkModulusLaw
from shake_ros.core.compiled import njit
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class Hoffmann(BulkModulusLaw):
    """Parameters of (2.38)."""

    largest_modulus: float = quantity("Pa", "E_max", low=1e6, high=1e11)
    offset: float = quantity("-", "exponent at zero pressure", low=0.0, high=10.0)
    rate: float = quantity("1/Pa", "rise of the exponent per pressure", low=0.0, high=1e-3)

    def at(self, pressure: np.ndarray) -> np.ndarray:
        return np.asarray(bulk_modulus(np.asarray(pressure, dtype=float), self.largest_modulus, self.offset, self.rate))


@njit
def bulk_modulus(pressure, e_max, offset, rate):
    """E(P) of (2.38) [Pa]."""
    return e_max * (1.0 - np.exp(-offset - rate * pressure))  # (2.38)
