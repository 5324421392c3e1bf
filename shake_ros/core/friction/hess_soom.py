"""Friction after Hess and Soom: a Stribeck hump that falls with the square of the velocity, (3.32).

    F(v) = [F_C + (F_s − F_C) / (1 + (v/v_s)²)] sign(v) + F_v v

The print leaves out the sign of the dry part. The sign at rest is the smooth step of tustin.py.
Source: thesis (3.32), citing Hess and Soom. Verified against the closed form; half of the hump is left at v = v_s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.core.compiled import njit
from shake_ros.core.friction.law import FrictionLaw
from shake_ros.core.quantities import quantity

CODE = 3


@dataclass(frozen=True)
class HessSoom(FrictionLaw):
    """Parameters of (3.32)."""

    code: ClassVar[int] = CODE

    coulomb_level: float = quantity("N", "Coulomb friction force F_C", low=0.0, high=1e5, live=True)
    static_level: float = quantity("N", "break-away force F_s", low=0.0, high=1e5, live=True)
    stribeck_velocity: float = quantity("m/s", "Stribeck velocity v_s", low=1e-6, high=1.0, live=True)
    viscous: float = quantity("N*s/m", "viscous coefficient F_v", low=0.0, high=1e6, live=True)
    transition_velocity: float = quantity("m/s", "width of the smooth sign at rest", low=1e-6, high=0.1)


@njit
def curve_level(p, velocity):
    """Dry friction force of (3.32) [N]."""
    relative = velocity / p.friction_stribeck_velocity
    return p.friction_coulomb_level + (p.friction_static_level - p.friction_coulomb_level) / (1.0 + relative * relative)
