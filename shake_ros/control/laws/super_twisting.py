"""Super-twisting control (6.50), (6.51).

S = K_ss1 ∫e_1 + K_ss2 e_1 + K_ss3 e_2 + K_ss4 e_3,
u = [−α_1 √|S| tanh(α_2 S) − α_3 ∫sign S] / b_0 − α_4 ẋ_ref, with b_0 = K_ss4 β_3.

(6.50) prints no b_0; by (5.38) the law of (5.40) is w = b_0 u, since Ṡ contains K_ss4 β_3 u. Without the division the
printed gains are bang-bang. Verified against: the difference equation by hand; finite-time arrival on the surface
of the reduced model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.control.laws.law import LawParameters, saturate, winds_up
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class TwistingSurface(LawParameters):
    """β_3 of the reduced model and the surface."""

    beta3: float = quantity("m/s^3", "jerk per command", low=1e-6, live=True)
    surface_integral: float = quantity("1/s", "K_ss1, weight of the integrated position error", low=0.0, live=True)
    surface_position: float = quantity("-", "K_ss2, weight of the position error", low=0.0, live=True)
    surface_velocity: float = quantity("s", "K_ss3, weight of the velocity error", low=0.0, live=True)
    surface_acceleration: float = quantity("s^2", "K_ss4, weight of the acceleration error", low=1e-9, live=True)


@dataclass(frozen=True, kw_only=True)
class SuperTwisting(TwistingSurface):
    """The gains of table 6.15."""

    code: ClassVar[int] = 3
    states: ClassVar[int] = 2

    root_gain: float = quantity("m^0.5/s", "α_1, of the square root", low=0.0, live=True)
    root_slope: float = quantity("1/m", "α_2, steepness of the tanh that approximates the sign", low=0.0, live=True)
    twisting_gain: float = quantity("m/s^2", "α_3, of the integrated sign", low=0.0, live=True)
    feedforward_gain: float = quantity("s/m", "α_4, minus the command per reference velocity", high=0.0, live=True)


@njit
def feedforward(p, reference):  # type: ignore[no-untyped-def]
    """−α_4 ẋ_ref of (6.50) [-]."""
    return -p.feedforward_gain * reference[1]


@njit
def surface_of(p, integral, error):  # type: ignore[no-untyped-def]
    """S (6.51) [m/s]."""
    value = p.surface_integral * integral + p.surface_position * error[0]
    return value + p.surface_velocity * error[1] + p.surface_acceleration * error[2]  # (6.51)


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; arguments and results as in `feedforward_pi.step`, state (∫e_1 [m·s], ∫sign S [s])."""
    limit, b0 = p.limit, p.surface_acceleration * p.beta3
    error = estimate - reference
    integral = state[0] + error[0] * dt
    surface = surface_of(p, integral, error)
    sign = 1.0 if surface > 0.0 else (-1.0 if surface < 0.0 else 0.0)
    root = p.root_gain * math.sqrt(abs(surface)) * math.tanh(p.root_slope * surface)
    twist = state[1] + sign * dt
    command = (-root - p.twisting_gain * twist) / b0 + feedforward  # (6.50)
    if winds_up(command, limit, -sign):
        twist = state[1]
        command = (-root - p.twisting_gain * twist) / b0 + feedforward
    if winds_up(command, limit, -error[0]):
        integral = state[0]
    following = np.empty(2)
    following[0] = integral
    following[1] = twist
    return following, saturate(command, limit)
