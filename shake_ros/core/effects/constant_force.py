"""A steady force along the travel: a tilted table, a hanging cable, a counterweight.

    M v̇ = … + F_0

Absent at F_0 = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class ConstantForce(Effect):
    """Steady external force."""

    place: ClassVar[str] = "force"
    depends_on: ClassVar[tuple[str, ...]] = ()
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    force: float = quantity("N", "force F_0 along +x", low=-1e5, high=1e5, default=0.0)
