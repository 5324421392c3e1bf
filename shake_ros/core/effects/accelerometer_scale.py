"""Wrong sensitivity of the accelerometer.

    a_m → (1 + e) a_m

Absent at e = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class AccelerometerScale(Effect):
    """Scale error of the accelerometer."""

    place: ClassVar[str] = "sensor"
    depends_on: ClassVar[tuple[str, ...]] = ()
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    error: float = quantity("-", "relative scale error e", low=-0.9, high=9.0, default=0.0)
