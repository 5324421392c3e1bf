"""The reaction mass or foundation gives way: position is measured to a base that moves itself.

    m_b ẍ_b = −F − k_b x_b − c ẋ_b,  v̇ = F/M − ẍ_b,  accelerometer: v̇ + ẍ_b

with k_b = 1/compliance, m_b = k_b/(2π f)². Absent at compliance 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class BaseFlexibility(Effect):
    """Foundation that moves under the reaction."""

    place: ClassVar[str] = "structure"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)

    compliance: float = quantity("m/N", "static compliance of the base", low=0.0, high=1e-4, default=0.0)
    frequency: float = quantity("Hz", "natural frequency of the base", low=0.5, high=200.0, default=12.0)
    damping: float = quantity("-", "damping ratio of the base", low=1e-3, high=1.0, default=0.05)


@njit
def base_acceleration(displacement, velocity, force, compliance, frequency, damping):
    """ẍ_b under the actuator force [m/s²]."""
    omega = 2.0 * math.pi * frequency
    return -omega * (omega * (compliance * force + displacement) + 2.0 * damping * velocity)
