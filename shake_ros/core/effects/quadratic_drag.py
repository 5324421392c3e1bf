"""Drag that grows with the square of the velocity: oil pushed through passages, air on a large specimen.

    F_d = c |v| v

Absent at c = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Drag quadratic in velocity."""

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("velocity",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    coefficient: float = quantity("N*s^2/m^2", "drag coefficient c", low=0.0, high=1e6, default=0.0)
