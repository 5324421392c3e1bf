"""Unequal metering edges: the valve passes more one way than the other.

    C_v → C_v (1 + a) for x_s > 0, C_v (1 − a) for x_s < 0

Absent at a = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class AsymmetricFlowGain(Effect):
    """Flow gain that differs with the direction of opening."""

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("direction", "valve_opening")
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    asymmetry: float = quantity("-", "relative excess of flow for positive opening", low=-0.8, high=0.8, default=0.0)


@njit
def flow_factor(spool, asymmetry):
    """Factor on the flow coefficient [-]."""
    return 1.0 + asymmetry if spool > 0.0 else 1.0 - asymmetry
