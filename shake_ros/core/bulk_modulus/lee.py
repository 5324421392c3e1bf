"""Empirical bulk modulus of hydraulic cylinders after Lee, (2.37), common in German literature.

    E = a_1 E_max log10(a_2 P/P_max + a_3),  a_1 = 0.5, a_2 = 90, a_3 = 3, E_max = 18000 bar, P_max = 280 bar

It includes entrained air and the walls. Range: 0 … P_max. Source: thesis, section 2.4.4. Verified by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.bulk_modulus.law import BulkModulusLaw
from shake_ros.core.compiled import njit
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class Lee(BulkModulusLaw):
    """Parameters of (2.37)."""

    largest_modulus: float = quantity("Pa", "E_max", low=1e6, high=1e11)
    largest_pressure: float = quantity("Pa", "P_max", low=1e5, high=1e9)
    a1: float = quantity("-", "factor a_1", low=0.0, high=10.0)
    a2: float = quantity("-", "factor a_2", low=0.0, high=1e4)
    a3: float = quantity("-", "summand a_3", low=1.0, high=1e3)

    def at(self, pressure: np.ndarray) -> np.ndarray:
        p = np.asarray(pressure, dtype=float)
        return np.asarray(bulk_modulus(p, self.largest_modulus, self.largest_pressure, self.a1, self.a2, self.a3))


@njit
def bulk_modulus(pressure, e_max, p_max, a_1, a_2, a_3):
    """E(P) of (2.37), decimal logarithm [Pa]."""
    return a_1 * e_max * np.log10(a_2 * pressure / p_max + a_3)  # (2.37)
