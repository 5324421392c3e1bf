"""Bulk modulus of the oil and what the chambers see of it: one file per published law, and the law of a record.

To add one: write its file (range, source, parameters, number, the compiled `bulk_modulus`), add its row here and a
file in config/bulk_modulus/. The plant and the tests over this table take it from here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.packing import dispatch, records
from shake_ros.physics.bulk_modulus.backe_murrenhoff import BackeMurrenhoff
from shake_ros.physics.bulk_modulus.eggerth import Eggerth
from shake_ros.physics.bulk_modulus.hoffmann import Hoffmann
from shake_ros.physics.bulk_modulus.ifas import LOWEST_PRESSURE, Ifas
from shake_ros.physics.bulk_modulus.law import BulkModulusLaw, Constant
from shake_ros.physics.bulk_modulus.lee import Lee
from shake_ros.physics.bulk_modulus.linear import Linear
from shake_ros.physics.bulk_modulus.nykanen import Nykanen
from shake_ros.physics.bulk_modulus.wylie_kajaste import WylieKajaste

BULK_MODULI: dict[str, type[BulkModulusLaw]] = {
    "constant": Constant,
    "linear": Linear,
    "wylie_kajaste": WylieKajaste,
    "nykanen": Nykanen,
    "backe_murrenhoff": BackeMurrenhoff,
    "ifas": Ifas,
    "lee": Lee,
    "hoffmann": Hoffmann,
    "eggerth": Eggerth,
}

__all__ = ["BULK_MODULI", "BulkModulusLaw"]

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
