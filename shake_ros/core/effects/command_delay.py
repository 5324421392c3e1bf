"""The command reaches the valve late: network, digital-to-analogue hold, drive electronics.

    u(t) → u(t − T), any fraction of a sample

Absent at T = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class CommandDelay(Effect):
    """Dead time between command and valve."""

    place: ClassVar[str] = "timing"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced", "axis")

    delay: float = quantity("s", "dead time T", low=0.0, high=0.5, default=0.0)
