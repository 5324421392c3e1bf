"""Elastic displacement before sliding: the asperities act as a spring until they break away (Dahl, LuGre (3.42)).

    ds/dx = (1 − s sign(ẋ)) / z_s,  dry force = level · s,  |s| ≤ 1

z_s is the sliding distance in which the force builds up: stiffness at rest = level / z_s. The law does not depend on
rate, so s follows exactly from the displacement since the last step, s = ±1 + (s_0 ∓ 1) exp(−|Δx|/z_s), and stays
harmless at any
stiffness. Absent at z_s = 0, where s is the smooth sign of the velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class PreslidingFriction(Effect):
    """Elastic pre-sliding displacement."""

    place: ClassVar[str] = "friction"
    depends_on: ClassVar[tuple[str, ...]] = ("position", "direction")
    models: ClassVar[tuple[str, ...]] = ("full", "axis")

    distance: float = quantity(
        "m", "displacement z_s in which the dry friction builds up", low=0.0, high=1e-2, default=0.0
    )


@njit
def deflection(start, displacement, distance):
    """Relative deflection s after a displacement, exact for motion one way [-]."""
    end = 1.0 if displacement > 0.0 else -1.0
    return end + (start - end) * math.exp(-abs(displacement) / distance)
