"""Leakage past the piston through a short gap or scratch, turbulent instead of laminar.

    Q_t = C_t sroot(P_A − P_B), added to the laminar (3.25)

Absent at C_t = 0. Same smooth root as the ports.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class TurbulentLeakage(Effect):
    """Turbulent leakage across the piston."""

    place: ClassVar[str] = "flow"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure",)

    coefficient: float = quantity("m^3/(s*sqrt(Pa))", "turbulent leakage coefficient", low=0.0, high=1e-6, default=0.0)
