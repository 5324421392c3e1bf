"""A spring between table and ground: cables, bellows, a reaction frame left coupled.

    M v̇ = … − k (x + x_b)

The ground does not move with a base that gives way (base_flexibility.py), so the spring sees the absolute position.
Absent at k = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class StiffnessToGround(Effect):
    """Spring between table and ground."""

    place: ClassVar[str] = "force"
    depends_on: ClassVar[tuple[str, ...]] = ("position",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    stiffness: float = quantity("N/m", "stiffness k", low=0.0, high=1e8, default=0.0)
