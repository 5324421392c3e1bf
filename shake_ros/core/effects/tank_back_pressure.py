"""The return line holds the tank ports above the declared pressure: a check valve, a filter, a raised tank.

    P_T → P_T + ΔP

Absent at ΔP = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class TankBackPressure(Effect):
    """Tank pressure above the declared one."""

    place: ClassVar[str] = "supply"
    depends_on: ClassVar[tuple[str, ...]] = ("flow",)

    pressure: float = quantity("Pa", "rise of the tank pressure ΔP", low=0.0, high=1e7, default=0.0)
