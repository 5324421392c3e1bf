"""Friction after Márton and Lantos: Tustin's law by two straight lines, (3.35)–(3.38).

    F_d1 = F_s + b_1 v,  b_1 = (F_C − F_s)/x_st + F_v                        the tangent at rest, (3.36)
    F_d2 = F(v_m) + b_2 (v − v_m),  b_2 = (F_C − F_s)/x_st exp(−v_m/x_st) + F_v   the tangent at v_m, (3.37)
    v_sw = (a_1 − a_2)/(b_2 − b_1)                                            where they meet, (3.38)

F(v) is F_d1 below v_sw and F_d2 above, odd in v. For (3.38) a_2 must be the value of F_d2 at v = 0, F(v_m) − b_2
v_m; the print's brace takes F(v_m) alone. Tustin's curve is convex, so both lines lie below it and the law is the
greater of the two. The sign at rest is the smooth step of tustin.py. Source: thesis (3.35)–(3.38). Verified against
Tustin's law.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.law import CurveWithStaticLevel
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class MartonLantos(CurveWithStaticLevel):
    """Parameters of (3.35)–(3.38)."""

    code: ClassVar[int] = 5

    stribeck_velocity: float = quantity("m/s", "Stribeck velocity x_st", low=1e-6, high=1.0, live=True)
    largest_velocity: float = quantity(
        "m/s", "largest velocity v_m of the data, where the second line touches", low=1e-3
    )


@njit
def curve_level(p, velocity):
    """Dry friction force: the greater line of (3.36), (3.37) less the viscous part, which both contain [N]."""
    speed = abs(velocity)
    rise = p.friction_static_level - p.friction_coulomb_level
    x_st, v_m = p.friction_stribeck_velocity, p.friction_largest_velocity
    first = p.friction_static_level - rise / x_st * speed  # (3.36)
    left = rise * math.exp(-v_m / x_st)
    second = p.friction_coulomb_level + left - left / x_st * (speed - v_m)  # (3.37)
    return max(first, second)  # (3.35)


@njit
def switch_velocity(p):
    """v_sw, where the two lines meet (3.38) [m/s]."""
    rise = p.friction_static_level - p.friction_coulomb_level
    x_st, v_m = p.friction_stribeck_velocity, p.friction_largest_velocity
    left = rise * math.exp(-v_m / x_st)
    a_1, b_1 = p.friction_static_level, -rise / x_st
    a_2, b_2 = p.friction_coulomb_level + left + left / x_st * v_m, -left / x_st
    return (a_1 - a_2) / (b_2 - b_1)  # (3.38)
