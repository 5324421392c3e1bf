"""Friction that differs with the direction of motion: a one-sided seal, a tilted guide.

    dry force → dry force · (1 + a sign(v))

On a force-driven axis the viscous part differs by the same share; there the offset carries what the dry part alone has.
Absent at a = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class FrictionAsymmetry(Effect):
    """Dry friction that differs with direction."""

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("direction",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    asymmetry: float = quantity("-", "relative excess of dry friction for v > 0", low=-1.0, high=1.0, default=0.0)
