"""The bulk modulus that a record asks for, by the law's number: one compiled function for all laws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.bulk_modulus import BULK_MODULI, BulkModulusLaw
from shake_ros.core.bulk_modulus.ifas import LOWEST_PRESSURE
from shake_ros.core.compiled import njit
from shake_ros.core.dispatch import dispatch
from shake_ros.core.packing import records

bulk_modulus = dispatch(__name__, BULK_MODULI, "bulk_modulus", "p.bulk_modulus_kind")


@njit
def modulus(p, pressure):
    """E(P) of the record's law [Pa]; below LOWEST_PRESSURE that of this pressure, so that a void stays finite."""
    return bulk_modulus(p, max(pressure, LOWEST_PRESSURE))


@njit
def modulus_of_each(law, pressures):
    """E of a law, as an array of one record, at pressures of shape (n,) [Pa]."""
    found = np.empty(pressures.shape[0])
    for i in range(pressures.shape[0]):
        found[i] = modulus(law[0], pressures[i])
    return found


def moduli(law: BulkModulusLaw, pressures: NDArray[np.float64]) -> NDArray[np.float64]:
    """Effective bulk modulus of a law at absolute pressures of shape (n,) [Pa]."""
    packed = records(BULK_MODULI, law, "bulk_modulus_")
    return np.asarray(modulus_of_each(packed, np.ascontiguousarray(pressures, dtype=np.float64)))
