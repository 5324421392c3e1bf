"""Oil between valve and piston that the declared volumes leave out, (3.24).

    V_A → V_A + V_d, V_B → V_B + V_d

Absent at V_d = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class DeadVolume(Effect):
    """Additional oil volume at each chamber."""

    place: ClassVar[str] = "compressibility"
    depends_on: ClassVar[tuple[str, ...]] = ("position",)

    volume: float = quantity("m^3", "volume V_d added to each chamber", low=0.0, high=1e-2, default=0.0)
