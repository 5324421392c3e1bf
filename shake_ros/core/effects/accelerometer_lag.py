"""A low-pass in the accelerometer's conditioner, first order.

    τ ȧ_m = a − a_m

Absent at τ = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class AccelerometerLag(Effect):
    """Low-pass of the accelerometer."""

    place: ClassVar[str] = "sensor"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    time_constant: float = quantity("s", "time constant τ", low=0.0, high=0.5, default=0.0)
