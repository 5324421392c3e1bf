"""The oil stiffens with pressure, (2.28): E = E_0 + m (P − P_0).

Absent at m = 0, where E is the declared constant. Evaluated by bulk_modulus/ifas.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class PressureDependentBulkModulus(Effect):
    """Bulk modulus that rises with pressure."""

    place: ClassVar[str] = "compressibility"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure",)

    slope: float = quantity("-", "rise of the bulk modulus per pressure m", low=0.0, high=300.0, default=0.0)
