"""What every law of the bulk modulus has: parameters and the modulus at a pressure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters


@dataclass(frozen=True)
class BulkModulusLaw(Parameters, ABC):
    """Base of the laws E(P)."""

    @abstractmethod
    def at(self, pressure: np.ndarray) -> np.ndarray:
        """Effective bulk modulus at absolute pressures of shape (n,) [Pa]."""
