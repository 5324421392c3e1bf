"""Friction that varies along the stroke: worn mid-stroke, a bent rod or a tight guide at one end.

    dry force → dry force + (c_1 x + c_2 x²) sign(v), held from below at zero dry force

Absent at c_1 = c_2 = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class PositionDependentFriction(Effect):
    """Dry friction that varies along the stroke."""

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("position", "direction")
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    gradient: float = quantity("N/m", "change of the dry friction per position c_1", low=-1e6, high=1e6, default=0.0)
    curvature: float = quantity("N/m^2", "change per squared position c_2", low=-1e8, high=1e8, default=0.0)


@njit
def dry_level(level, position, gradient, curvature):
    """Dry friction level at a position [N]."""
    return max(level + (gradient + curvature * position) * position, 0.0)
