"""Play between piston rod and table: a worn clevis or spherical bearing.

The rod moves by δ relative to the table; beyond half the gap g a stiff spring with a damper carries the force.

    F_c = k_g dz(δ) + c δ̇ in contact, m_r v̇_r = A_p P_L − friction − F_c, (M − m_r) v̇ = F_c
    k_g = k (1 + q), ζ_g = ζ + (1 − ζ) q/(1 + q), q = (g_s/g)²

Friction acts on the rod (seals). Absent at g = 0, where rod and table are one body. A joint without play is as stiff as
the rod and does not rattle, so the contact stiffens below g_s = 5 µm, critically damped in the end, and the limit of a
small gap is the rigid joint of the declared model: no jump at the value at which the effect is absent. From 20 µm on
k_g is k to within a few per cent.
Verified against the same two bodies written a second time and Radau, and against the declared model as g → 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.effects.effect import Effect
from shake_ros.core.quantities import quantity


@dataclass(frozen=True)
class CouplingBacklash(Effect):
    """Play between piston rod and table."""

    place: ClassVar[str] = "structure"
    depends_on: ClassVar[tuple[str, ...]] = ("load_pressure", "direction")

    gap: float = quantity("m", "total play g", low=0.0, high=1e-2, default=0.0)
    stiffness: float = quantity("N/m", "contact stiffness k", low=1e5, high=1e9, default=5e7)
    rod_mass: float = quantity("kg", "mass m_r on the piston's side of the play", low=1.0, high=300.0, default=30.0)
    damping: float = quantity("-", "damping ratio of the contact on the rod's mass", low=0.0, high=2.0, default=0.2)


STIFFENING_GAP = 5e-6  # g_s [m]
NO_GAP = 1e-7  # [m] below it rod and table count as one body; the joint would be 2500 times stiffer than its contact


@njit
def has_play(gap):
    """Whether rod and table are two bodies."""
    return gap > NO_GAP


@njit
def contact_force(deflection, rate, gap, stiffness, rod_mass, damping):
    """Force of the rod on the table [N]; never pulls while contact is being lost."""
    half = 0.5 * gap
    closing = (STIFFENING_GAP / gap) ** 2
    stiffness *= 1.0 + closing
    damping += max(1.0 - damping, 0.0) * closing / (1.0 + closing)
    coefficient = 2.0 * damping * math.sqrt(stiffness * rod_mass)
    if deflection > half:
        return max(stiffness * (deflection - half) + coefficient * rate, 0.0)
    if deflection < -half:
        return min(stiffness * (deflection + half) + coefficient * rate, 0.0)
    return 0.0
