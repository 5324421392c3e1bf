"""Simplified servo-valve: second-order spool dynamics with hysteresis, gain, stroke and rate limit, (3.19)–(3.22).

    ẍ_s*/ω_v² + (2D_v/ω_v) ẋ_s* + x_s* + f_hs sign(ẋ_s*) = k_v u,  |x_s*| ≤ 1

The Coulomb term f_hs sign(ẋ_s*) moves the position of rest by f_hs against the motion and holds the spool wherever it
comes to a halt within f_hs of k_v u. Source: thesis (3.19)–(3.22); verified against the closed-form second-order
response and a finely stepped solution with dry friction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from shake_ros.compiled import njit
from shake_ros.quantities import Parameters, quantity

FINE = 0.02  # ω_v times the small steps of `limited_motion`


@dataclass(frozen=True)
class SimplifiedValve(Parameters):
    """Parameters of (3.19)–(3.22) and of the ports (3.17), (6.12)."""

    code: ClassVar[int] = 0

    natural_frequency: float = quantity("rad/s", "spool natural frequency ω_v", low=10.0, high=1e4)
    damping: float = quantity("-", "spool damping ratio D_v", low=0.05, high=5.0)
    gain: float = quantity("-", "spool position per command k_v", low=0.01, high=10.0)
    hysteresis: float = quantity("-", "hysteresis half-width f_hs", low=0.0, high=0.5)
    rate_limit: float = quantity("1/s", "largest spool speed", low=1.0, high=1e4)
    flow_coefficient: float = quantity(
        "m^3/(s*sqrt(Pa))", "flow coefficient C_v of (3.17)", low=1e-9, high=1e-4, live=True
    )
    underlap: float = quantity("-", "port underlap d_s, negative for overlap", low=-0.5, high=0.5)
    laminar_pressure: float = quantity("Pa", "pressure drop of the laminar-turbulent transition", low=1.0, high=1e6)
    radial_clearance: float = quantity(
        "-", "radial clearance c_rs of the spool, per stroke", low=0.0, high=0.1, default=0.0
    )


@njit
def backlash(held, wanted, width):
    """Command after a backlash of half-width `width`: moves only when pushed by an edge [-]."""
    return min(max(held, wanted - width), wanted + width)


@njit
def rest_position(spool, rate, wanted, friction):
    """Position towards which the spool moves with dry friction (3.19); its own place where friction holds it [-]."""
    if rate == 0.0:
        gap = wanted - spool
        return wanted - min(max(gap, -friction), friction)
    return wanted - friction if rate > 0.0 else wanted + friction


@njit
def halt(distance, rate, omega_v, damping):
    """Time until a spool that moves by (3.19) from x_s* − w = `distance` comes to a halt, inf where it does not [s].

    >>> round(halt(-1.0, 0.0, 1000.0, 0.6) * 800.0 / math.pi, 9)  # half a period of the damped oscillation
    1.0
    >>> halt(-1.0, 0.0, 1000.0, 1.0)
    inf
    """
    if distance == 0.0 and rate == 0.0:
        return math.inf
    way = rate if rate != 0.0 else -distance
    side = 1.0 if way > 0.0 else -1.0
    speed = abs(rate)
    slope = side * (damping * omega_v * rate + omega_v * omega_v * distance)
    square = (1.0 - damping * damping) * omega_v * omega_v
    if square > 0.0:
        omega_d = math.sqrt(square)
        return math.atan2(speed * omega_d, slope) / omega_d
    if square == 0.0:
        return speed / slope if slope > 0.0 and speed > 0.0 else math.inf
    spread = math.sqrt(-square)
    ratio = speed * spread / slope if slope > 0.0 else 1.0
    return math.atanh(ratio) / spread if 0.0 < ratio < 1.0 else math.inf


@njit
def spool_acceleration(spool, spool_rate, wanted, omega_v, damping):
    """ẍ_s* of (3.19) [1/s²]."""
    return omega_v * (omega_v * (wanted - spool) - 2.0 * damping * spool_rate)


@njit
def motion_weights(omega_v, damping, time):
    """Weights (a, b, c) of the exact motion (3.19) under a held command w.

    With d = x_s* − w and r = ẋ_s* at the start: x_s* = w + a d + b r and ẋ_s* = −ω_v² b d + c r after `time` [s].
    Holds within stroke and rate limit, for any damping.

    >>> a, b, c = motion_weights(2.0, 1.0, 0.5)  # critical: (1 + ω t) exp(−ω t), t exp(−ω t), (1 − ω t) exp(−ω t)
    >>> [round(float(w) * math.e, 9) for w in (a, b, c)]
    [2.0, 0.5, 0.0]
    """
    sigma = damping * omega_v
    square = (1.0 - damping * damping) * omega_v * omega_v
    small = square * time * time
    if small > 1e-6:
        omega_d = math.sqrt(square)
        decay = math.exp(-sigma * time)
        even, odd = decay * math.cos(omega_d * time), decay * math.sin(omega_d * time) / omega_d
    elif small < -1e-6:
        spread = math.sqrt(-square)
        slow, fast = math.exp((spread - sigma) * time), math.exp(-(spread + sigma) * time)
        even, odd = 0.5 * (slow + fast), 0.5 * (slow - fast) / spread
    else:
        decay = math.exp(-sigma * time)
        even, odd = decay * (1.0 - 0.5 * small), decay * time * (1.0 - small / 6.0)
    return even + sigma * odd, odd, even - sigma * odd


@njit
def limited_motion(spool, rate, wanted, friction, omega_v, damping, limit, duration):
    """(x_s*, ẋ_s*) after a motion with dry friction, |x_s*| ≤ 1 and |ẋ_s*| ≤ limit, (3.19)–(3.21), by midpoint rule.

    At the limit the spool is driven by all the flow of its pilot stage: it keeps that speed until (3.19) slows it down.
    """
    count = max(1, math.ceil(duration * omega_v / FINE))
    part = duration / count
    for _ in range(count):
        target, before = rest_position(spool, rate, wanted, friction), rate
        middle = rate + 0.5 * part * spool_acceleration(spool, rate, target, omega_v, damping)
        middle = min(max(middle, -limit), limit)
        spool_middle = spool + 0.5 * part * rate
        rate += part * spool_acceleration(spool_middle, middle, target, omega_v, damping)
        rate = min(max(rate, -limit), limit)
        spool += part * middle
        if friction > 0.0 and rate * before < 0.0:
            rate = 0.0
        if abs(spool) > 1.0:
            spool, rate = min(max(spool, -1.0), 1.0), 0.0
    return spool, rate
