"""The classical law: Coulomb, viscous and static friction, (3.27)–(3.31).

    F(v) = F_C sign(v) + f_v |v|^δ sign(v) in motion,  F = F_ext up to F_s at rest

A force that jumps from F_s to F_C at v = 0 has no solution that an integrator could follow. Here the sign is the
smooth step tanh(v/v_t) and the static excess F_s − F_C acts as a bump exp(−(v/(3 v_t))²) over the same narrow range:
below v_t the table creeps, above some 6 v_t the law is (3.27) + (3.30). (3.28) prints the two signs exchanged.
Source: thesis (3.27)–(3.31). Verified against the closed form outside the transition.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.law import FrictionLaw
from shake_ros.quantities import quantity

SLOWEST = 1e-9  # [m/s] a viscous exponent below one has an infinite slope at rest


@dataclass(frozen=True)
class CoulombViscousStatic(FrictionLaw):
    """Parameters of (3.27)–(3.31)."""

    code: ClassVar[int] = 2

    coulomb_level: float = quantity("N", "Coulomb friction force F_C", low=0.0, high=1e5, live=True)
    static_level: float = quantity("N", "break-away force F_s", low=0.0, high=1e5, live=True)
    viscous: float = quantity("N*s/m", "viscous coefficient f_v, at 1 m/s", low=0.0, high=1e6, live=True)
    viscous_exponent: float = quantity("-", "exponent δ of the viscous part", low=0.2, high=3.0)
    transition_velocity: float = quantity("m/s", "width of the smooth sign at rest", low=1e-6, high=0.1)


@njit
def at_rest(external_force, static_level):
    """Static friction under an external force (3.31) [N].

    >>> float(at_rest(40.0, 100.0)), float(at_rest(-140.0, 100.0))
    (40.0, -100.0)
    """
    return min(max(external_force, -static_level), static_level)


@njit
def curve_level(p, velocity):
    """Dry friction force (3.27), near rest (3.31) [N]."""
    slow = velocity / (3.0 * p.friction_transition_velocity)
    rise = (p.friction_static_level - p.friction_coulomb_level) * math.exp(-slow * slow)
    return p.friction_coulomb_level + rise


@njit
def viscous_coefficient(p, velocity):
    """f_v |v|^(δ−1), which times v is (3.29), (3.30) [N·s/m]."""
    if p.friction_viscous_exponent == 1.0:
        return p.friction_viscous
    return p.friction_viscous * max(abs(velocity), SLOWEST) ** (p.friction_viscous_exponent - 1.0)
