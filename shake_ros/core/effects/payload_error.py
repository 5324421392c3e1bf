"""The specimen weighs something else than was declared.

    M → M + Δm

Absent at Δm = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class PayloadError(Effect):
    """Moved mass other than declared."""

    place: ClassVar[str] = "structure"
    depends_on: ClassVar[tuple[str, ...]] = ()

    mass: float = quantity("kg", "mass Δm beyond the declared one", low=-2e3, high=1e4, default=0.0)
