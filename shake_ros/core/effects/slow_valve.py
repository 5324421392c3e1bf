"""A valve slower than its catalogue: low pilot pressure, a contaminated filter or a weak amplifier.

    ω_v → ω_v (1 − s)

and, in the reduced model (6.36), which declares a valve without dynamics, τ ẋ_s = u − x_s. Absent at s = 0, τ = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class SlowValve(Effect):
    """Spool dynamics slower than declared."""

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    slowdown: float = quantity("-", "relative loss of the spool natural frequency", low=-1.0, high=0.97, default=0.0)
    time_constant: float = quantity("s", "lag τ of the valve in the reduced model", low=0.0, high=2.0, default=0.0)
