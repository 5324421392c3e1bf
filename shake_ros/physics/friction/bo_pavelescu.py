"""Friction after Bo and Pavelescu: an exponential Stribeck hump of free exponent, (3.33).

    F(v) = [F_C + (F_s − F_C) exp(−(|v|/v_s)^n)] sign(v) + F_v v

n = 0.5 … 1 after Bo and Pavelescu, 2 after Armstrong-Hélouvry, very large for boundary lubricants. The print
leaves out the sign of the dry part. The sign at rest is the smooth step of tustin.py.
Source: thesis (3.33). Verified against the closed form; with n = 1 it is Tustin's law (3.34).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.law import CurveWithStaticLevel
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class BoPavelescu(CurveWithStaticLevel):
    """Parameters of (3.33)."""

    code: ClassVar[int] = 4

    stribeck_exponent: float = quantity("-", "exponent n of the Stribeck curve", low=0.2, high=10.0)


@njit
def curve_level(p, velocity):
    """Dry friction force of (3.33) [N]."""
    fall = math.exp(-((abs(velocity) / p.friction_stribeck_velocity) ** p.friction_stribeck_exponent))
    return p.friction_coulomb_level + (p.friction_static_level - p.friction_coulomb_level) * fall
