"""Tustin's friction: an exponential fall from break-away to Coulomb level plus a viscous part, (3.34), (6.10).

    F(v) = (θ_1 + θ_2 exp(−θ_3 |v|)) sign(v) + θ_4 v

θ_1 is the Coulomb level, θ_1 + θ_2 the break-away level, θ_3 the inverse Stribeck velocity. At v = 0 the sign is
a smooth step tanh(v/v_t) over the transition velocity v_t, which is far below the velocities of a test; the table
creeps instead of sticking below it. How abruptly a real one ends its creep is not known beforehand: with u = v/v_t the
step is

    tanh(u + w (u³/3 + u⁵/5 + u⁷/7)),

where w = 0 is the step of the thesis and w = 1 nearly a straight ramp, since the series is that of artanh.
Source: thesis (3.34), (6.10), (6.15). Verified against the closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.physics.friction.law import FrictionLaw
from shake_ros.quantities import quantity

TUSTIN = 0


@dataclass(frozen=True)
class Tustin(FrictionLaw):
    """Parameters of (3.34)."""

    code: ClassVar[int] = TUSTIN

    coulomb_level: float = quantity("N", "Coulomb friction force θ_1", low=0.0, high=1e5, live=True)
    stribeck_rise: float = quantity("N", "break-away force above the Coulomb level θ_2", low=0.0, high=1e5, live=True)
    stribeck_decay: float = quantity("s/m", "inverse Stribeck velocity θ_3", low=0.0, high=1e4, live=True)
    viscous: float = quantity("N*s/m", "viscous coefficient θ_4", low=0.0, high=1e6, live=True)
    transition_velocity: float = quantity("m/s", "width of the smooth sign at rest", low=1e-6, high=0.1)
    transition_sharpness: float = quantity(
        "-", "shape of that sign: 0 tanh, 1 nearly a ramp", low=0.0, high=10.0, default=0.0
    )


@njit
def curve_level(p, velocity):
    """Dry friction force at |v| > 0 (3.34) [N]."""
    fall = math.exp(-p.friction_stribeck_decay * abs(velocity))
    return p.friction_coulomb_level + p.friction_stribeck_rise * fall


@njit
def direction(p, velocity):
    """Smooth sign(v) of the laws that are a curve [-]."""
    u, sharpness = velocity / p.friction_transition_velocity, p.friction_transition_sharpness
    if sharpness == 0.0:
        return math.tanh(u)
    square = u * u
    return math.tanh(u + sharpness * u * square * (1.0 / 3.0 + square * (0.2 + square / 7.0)))
