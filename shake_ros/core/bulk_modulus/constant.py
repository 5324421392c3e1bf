"""The same bulk modulus at every pressure: the `none` of this family."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.bulk_modulus.law import BulkModulusLaw
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class Constant(BulkModulusLaw):
    """E does not depend on the pressure."""

    modulus: float = quantity("Pa", "bulk modulus E", low=1e6, high=1e11)

    def at(self, pressure: np.ndarray) -> np.ndarray:
        return np.full(np.shape(pressure), self.modulus)
