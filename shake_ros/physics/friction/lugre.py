"""The LuGre law: bristles that bend before they slide, (3.42)–(3.44).

    ż = v − σ_0 |v| z / g(v),  g(v) = F_c + (F_s − F_c) exp(−(|v|/v_s)^n),  F = σ_0 z + σ_1 ż + σ_2 v

The print drops σ_0 in (3.42), without which z is no deflection. g and σ_2 may differ with the direction of motion:
names ending in `_reverse` hold for v < 0. Tables 6.5–6.7 print the values for one direction with the force's sign;
here they are magnitudes.

z is stiff (rate σ_0|v|/g of 1e4 1/s and more), but linear in z, and per displacement instead of time the rate is κ =
σ_0/g whatever the speed. Over a step with displacement Δx one way, g known at both ends, Φ = κ_mean |Δx| and r =
±g/σ_0 linear between,

    z_1 = r_1 + (z_0 − r_0) e^(−Φ) − (r_1 − r_0)(1 − e^(−Φ))/Φ

is exact: no step size can make it unstable, and it keeps the lag of z behind g that the law is about. Where the
motion reverses within the step, g of its end is taken for the whole of the (small) net displacement.

Source: thesis (3.42)–(3.44), with the equation sheet's σ_0. Verified against Radau with z as an ordinary state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.law import FrictionLaw
from shake_ros.quantities import quantity


@dataclass(frozen=True)
class Bristles(FrictionLaw):
    """Base of the laws with bristles: parameters of (3.42)–(3.44), magnitudes."""

    coulomb_level: float = quantity("N", "Coulomb friction force F_c, v > 0", low=1e-3, high=1e5, live=True)
    coulomb_level_reverse: float = quantity("N", "Coulomb friction force F_c, v < 0", low=1e-3, high=1e5, live=True)
    static_level: float = quantity("N", "break-away force F_s, v > 0", low=1e-3, high=1e5, live=True)
    static_level_reverse: float = quantity("N", "break-away force F_s, v < 0", low=1e-3, high=1e5, live=True)
    stribeck_velocity: float = quantity("m/s", "Stribeck velocity v_s, v > 0", low=1e-6, high=1.0, live=True)
    stribeck_velocity_reverse: float = quantity("m/s", "Stribeck velocity v_s, v < 0", low=1e-6, high=1.0, live=True)
    stribeck_exponent: float = quantity("-", "exponent n of the Stribeck curve, v > 0", low=0.2, high=10.0)
    stribeck_exponent_reverse: float = quantity("-", "exponent n of the Stribeck curve, v < 0", low=0.2, high=10.0)
    viscous: float = quantity("N*s/m", "viscous coefficient σ_2, v > 0", low=0.0, high=1e6, live=True)
    viscous_reverse: float = quantity("N*s/m", "viscous coefficient σ_2, v < 0", low=0.0, high=1e6, live=True)
    contact_stiffness: float = quantity("N/m", "stiffness σ_0 of the bristles", low=1e4, high=1e10)
    contact_damping: float = quantity("N*s/m", "damping σ_1 of the bristles", low=0.0, high=1e6)


@dataclass(frozen=True)
class LuGre(Bristles):
    """The law of (3.42)–(3.44)."""

    code: ClassVar[int] = 11


@njit
def contact_level(p, velocity, film, rise):
    """g(v, h) of (3.43), with a film thickness h > 0 of (3.46) [N]; without a film h = 0, `rise` plays no part."""
    if velocity >= 0.0:
        f_c, f_s = p.friction_coulomb_level, p.friction_static_level
        v_s, n = p.friction_stribeck_velocity, p.friction_stribeck_exponent
    else:
        f_c, f_s = p.friction_coulomb_level_reverse, p.friction_static_level_reverse
        v_s, n = p.friction_stribeck_velocity_reverse, p.friction_stribeck_exponent_reverse
    return f_c + ((1.0 - film) * f_s - f_c) * math.exp(-((abs(velocity) / v_s) ** n))


@njit
def contact_deflection(p, z, displacement, velocity_start, velocity, film_start, film, rise):
    """z after a displacement one way, exact for κ = σ_0/g constant and r = g/σ_0 linear over it (3.42), (3.45) [m]."""
    if displacement == 0.0:
        return z
    sign = 1.0 if displacement > 0.0 else -1.0
    sigma_0 = p.friction_contact_stiffness
    if velocity_start * sign > 0.0 and velocity * sign > 0.0:
        g_0 = contact_level(p, velocity_start, film_start, rise)
        g_1 = contact_level(p, velocity, film, rise)
    else:
        g_0 = g_1 = contact_level(p, sign * abs(velocity), film, rise)
    phi = abs(displacement) * sigma_0 * 0.5 * (1.0 / g_0 + 1.0 / g_1)
    r_0, r_1 = sign * g_0 / sigma_0, sign * g_1 / sigma_0
    decay = math.exp(-phi)
    return r_1 + (z - r_0) * decay + (r_1 - r_0) * math.expm1(-phi) / phi


@njit
def micro_damping(p, velocity, share):
    """σ_1 ż of (3.44), with σ_0 z/g(v) = `share` [N]."""
    return p.friction_contact_damping * (velocity - abs(velocity) * share)


@njit
def viscous_coefficient(p, velocity):
    """σ_2 of the direction of motion (3.44) [N·s/m]."""
    return p.friction_viscous if velocity >= 0.0 else p.friction_viscous_reverse
