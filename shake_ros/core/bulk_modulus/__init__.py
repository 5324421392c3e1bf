"""Bulk modulus of the oil and what the chambers see of it: one file per published law.

To add one: write its file (range, source, parameters, number, the compiled `bulk_modulus`), add its row here and a
file in config/bulk_modulus/. `selected`, the plant and the tests over this table take it from here.
"""

from __future__ import annotations

from shake_ros.core.bulk_modulus.backe_murrenhoff import BackeMurrenhoff
from shake_ros.core.bulk_modulus.constant import Constant
from shake_ros.core.bulk_modulus.eggerth import Eggerth
from shake_ros.core.bulk_modulus.hoffmann import Hoffmann
from shake_ros.core.bulk_modulus.ifas import Ifas
from shake_ros.core.bulk_modulus.law import BulkModulusLaw
from shake_ros.core.bulk_modulus.lee import Lee
from shake_ros.core.bulk_modulus.linear import Linear
from shake_ros.core.bulk_modulus.nykanen import Nykanen
from shake_ros.core.bulk_modulus.wylie_kajaste import WylieKajaste

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
