"""A low-pass in the position transducer's demodulator, first order.

    τ ẋ_m = x − x_m

Absent at τ = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class PositionSensorLag(Effect):
    """Low-pass of the position transducer."""

    place: ClassVar[str] = "sensor"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    time_constant: float = quantity("s", "time constant τ", low=0.0, high=0.5, default=0.0)
