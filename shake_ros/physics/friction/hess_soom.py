"""Friction after Hess and Soom: a Stribeck hump that falls with the square of the velocity, (3.32).

    F(v) = [F_C + (F_s − F_C) / (1 + (v/v_s)²)] sign(v) + F_v v

The print leaves out the sign of the dry part. The sign at rest is the smooth step of tustin.py.
Source: thesis (3.32), citing Hess and Soom. Verified against the closed form; half of the hump is left at v = v_s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.law import CurveWithStaticLevel


@dataclass(frozen=True)
class HessSoom(CurveWithStaticLevel):
    """Parameters of (3.32)."""

    code: ClassVar[int] = 3


@njit
def curve_level(p, velocity):
    """Dry friction force of (3.32) [N]."""
    relative = velocity / p.friction_stribeck_velocity
    return p.friction_coulomb_level + (p.friction_static_level - p.friction_coulomb_level) / (1.0 + relative * relative)
