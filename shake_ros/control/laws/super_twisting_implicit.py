"""Super-twisting control (5.40), discretised implicitly and conditioned on the saturated command.

The continuous law on Ṡ = w + φ, with w = b_0 (u − u_ff) and φ of bounded slope L, is w = −k_1 √|S| sgn S + ν,
ν̇ = −k_2 sgn S; S as (6.51). Between samples S' = S + T (w + φ). Let z be S' without what ν does not yet know of φ,
z = S' − T (ν' + φ). Asking the root and the sign at z, at the end of the sample, gives

    z + T k_1 √|z| sgn z + T² k_2 ξ = S,  ξ ∈ Sgn z,  w = −k_1 √|z| sgn z + ν − 2 T k_2 ξ,  ν' = ν − T k_2 ξ,

whose one solution is closed: z = 0 and ξ = S/(T² k_2) where |S| ≤ T² k_2. There S' = T (φ_k − φ_{k−1}), no more than
L T², the best that a command held over a sample can do, and the command does not chatter; the explicit law switches by
2 T k_2 for ever.

Saturation: w is what the limited command leaves of it, and ξ is read back from that,
ξ = clip((ν − w)/(2 T k_2), −1, 1): without saturation it is the same ξ, with it ν turns towards what the valve can do
and does not wind up (the conditioning of Seeber and Reichhartinger 2020; the implicit form after Seeber and Andritsch
2025, Automatica 173, 112027, derived here anew, signs and scaling our own). ∫e_1 stops as in `super_twisting`.

Verified against: the bound L T² on the surface; the continuous law for T → 0; arrival from far away without overshoot
under saturation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.control.laws.law import saturate, winds_up
from shake_ros.control.laws.super_twisting import TwistingSurface, surface_of
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class SuperTwistingImplicit(TwistingSurface):
    """k_1, k_2 of (5.40) and the feedforward."""

    code: ClassVar[int] = 5
    states: ClassVar[int] = 2

    root_gain: float = quantity("m^0.5/s", "k_1, of the square root", low=0.0, live=True)
    twisting_gain: float = quantity("m/s^2", "k_2, of the integrated sign", low=1e-9, live=True)
    feedforward_gain: float = quantity("s/m", "command per reference velocity", low=0.0, live=True)


@njit
def feedforward(p, reference):  # type: ignore[no-untyped-def]
    """K_ff ẋ_ref [-]."""
    return p.feedforward_gain * reference[1]


@njit
def root_and_sign(surface, k1, k2, dt):  # type: ignore[no-untyped-def]
    """(√|z| sgn z, ξ), the solution of z + T k_1 √|z| sgn z + T² k_2 ξ = S with ξ ∈ Sgn z.

    >>> root, sign = root_and_sign(0.5e-6, 1.0, 1.0, 1e-3)
    >>> float(root), round(float(sign), 12)
    (0.0, 0.5)
    """
    reach = dt * dt * k2
    if abs(surface) <= reach:
        return 0.0, surface / reach
    half = 0.5 * dt * k1
    root = (abs(surface) - reach) / (half + math.sqrt(half * half + abs(surface) - reach))
    return (root, 1.0) if surface > 0.0 else (-root, -1.0)


@njit
def twisting(surface, twist, k1, k2, dt):  # type: ignore[no-untyped-def]
    """w of (5.40) for a surface S and ν of the sample before, as if nothing saturates."""
    root, sign = root_and_sign(surface, k1, k2, dt)
    return -k1 * root + twist - 2.0 * dt * k2 * sign  # (5.40)


@njit
def conditioned(twist, applied, k2, dt):  # type: ignore[no-untyped-def]
    """ν' after a sample in which w = `applied` acted."""
    sign = max(-1.0, min(1.0, (twist - applied) / (2.0 * dt * k2)))
    return twist - dt * k2 * sign


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; arguments and results as in `feedforward_pi.step`, state (∫e_1 [m·s], ν [m/s])."""
    limit, k1, k2 = p.limit, p.root_gain, p.twisting_gain
    b0 = p.surface_acceleration * p.beta3
    error = estimate - reference
    integral = state[0] + error[0] * dt
    surface = surface_of(p, integral, error)
    command = twisting(surface, state[1], k1, k2, dt) / b0 + feedforward
    u = saturate(command, limit)
    if winds_up(command, limit, -error[0]):
        integral = state[0]
    following = np.empty(2)
    following[0] = integral
    following[1] = conditioned(state[1], b0 * (u - feedforward), k2, dt)
    return following, u
