"""Zero offset of the accelerometer, or its tilt.

    a_m → a_m + b

Absent at b = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class AccelerometerBias(Effect):
    """Zero offset of the accelerometer."""

    place: ClassVar[str] = "sensor"
    depends_on: ClassVar[tuple[str, ...]] = ()
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    bias: float = quantity("m/s^2", "offset b", low=-50.0, high=50.0, default=0.0)
