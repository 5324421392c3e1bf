"""A flexible specimen: part m_q of the moved mass stands on a spring and damper (one storey).

    q̈ = −a − 2 ζ ω q̇ − ω² q,  table force + m_q (2 ζ ω q̇ + ω² q),  rigid mass M − m_q

q is the specimen's displacement relative to the table, a the table's absolute acceleration. Absent at m_q = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class SpecimenResonance(Effect):
    """Flexible specimen of one storey."""

    place: ClassVar[str] = "structure"
    depends_on: ClassVar[tuple[str, ...]] = ("frequency",)
    models: ClassVar[tuple[str, ...]] = ("full", "reduced")

    mass: float = quantity("kg", "mass m_q that moves on the spring", low=0.0, high=5e3, default=0.0)
    frequency: float = quantity("Hz", "natural frequency on a table at rest", low=0.2, high=200.0, default=8.0)
    damping: float = quantity("-", "damping ratio ζ", low=1e-3, high=1.0, default=0.03)


@njit
def spring_force(deflection, rate, mass, frequency, damping):
    """Force of the specimen on the table [N]."""
    omega = 2.0 * math.pi * frequency
    return mass * omega * (2.0 * damping * rate + omega * deflection)
