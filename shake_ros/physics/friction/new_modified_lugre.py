"""New modified LuGre: the film's law with a lead in the fluid friction, (3.52).

    F = σ_0 z + σ_1 ż + σ_2 (v + T v̇)

The term σ_2 T v̇ is proportional to the acceleration, so it acts as a mass σ_2 T that moves with the piston and is
solved for as such, without a derivative. All else is modified_lugre.py. Source: thesis (3.52). Verified against the
closed form of the fluid part under a sine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.lugre import viscous_coefficient
from shake_ros.physics.friction.modified_lugre import Film
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class NewModifiedLuGre(Film):
    """Parameters of (3.52): those of the film and the lead."""

    code: ClassVar[int] = 13

    fluid_time: float = quantity("s", "time constant T of the fluid friction", low=0.0, high=10.0)


@njit
def inertia(p, velocity):
    """σ_2 T, the mass by which the lead acts [kg]."""
    return viscous_coefficient(p, velocity) * p.friction_fluid_time
