"""The hydraulic null lies off the electrical zero: the table drifts at u = 0.

    x_s follows k_v (u + u_0)

Absent at u_0 = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class ValveNullShift(Effect):
    """Offset between command and hydraulic null."""

    place: ClassVar[str] = "valve"
    depends_on: ClassVar[tuple[str, ...]] = ("valve_opening",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    offset: float = quantity("-", "command that is equivalent to the null shift", low=-0.3, high=0.3, default=0.0)
