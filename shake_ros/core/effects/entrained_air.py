"""Free air in the oil, (2.32): the mixture is soft at low pressure.

α is the volume fraction of air at the table's `bulk_modulus.reference_pressure`. Absent at α = 0.
Evaluated by bulk_modulus/ifas.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class EntrainedAir(Effect):
    """Free air in the oil."""

    place: ClassVar[str] = "compressibility"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure",)

    fraction: float = quantity(
        "-", "volume fraction α of free air at atmospheric pressure", low=0.0, high=0.3, default=0.0
    )
    polytropic_exponent: float = quantity("-", "polytropic exponent κ of the air", low=0.3, high=2.0, default=1.4)
