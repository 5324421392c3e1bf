"""The input filter (5.1) sample by sample: ẍ + 2ξ_f ω_f ẋ + ω_f² x = ω_f² r, exact for a wish that runs straight.

With r = r_0 + ṙ t a particular solution is x = r − 2ξ_f ṙ/ω_f, ẋ = ṙ; what is left decays freely.
Verified against: `core.reference.filter`, which takes the matrix exponential.
"""

from __future__ import annotations

import math

from shake_ros.core.compiled import njit


@njit
def free_motion(x, v, frequency, damping, dt):  # type: ignore[no-untyped-def]
    """(x, ẋ) after `dt` of ẍ + 2ξω ẋ + ω² x = 0, ξ < 1."""
    decay, damped = damping * frequency, frequency * math.sqrt(1.0 - damping * damping)
    c, s = math.cos(damped * dt), math.sin(damped * dt) / damped
    fade = math.exp(-decay * dt)
    return fade * (x * c + (v + decay * x) * s), fade * (v * c - (frequency**2 * x + decay * v) * s)


@njit
def advance(x, v, wish_before, wish, frequency, damping, dt):  # type: ignore[no-untyped-def]
    """(x, ẋ, ẍ)_ref after a sample in which the wish ran straight from `wish_before` to `wish` [m]."""
    slope = (wish - wish_before) / dt
    lag = 2.0 * damping * slope / frequency
    x, v = free_motion(x - wish_before + lag, v - slope, frequency, damping, dt)
    x, v = x + wish - lag, v + slope
    return x, v, frequency**2 * (wish - x) - 2.0 * damping * frequency * v  # (5.1)


@njit
def moving(reference, frequency, damping):  # type: ignore[no-untyped-def]
    """(x, ẋ, ẍ)_ref of a filter that has followed the reference for long, its acceleration being constant."""
    lag, spread = 2.0 * damping / frequency, 1.0 / frequency**2
    x, v, a = reference[0], reference[1], reference[2]
    return x - lag * v + (lag * lag - spread) * a, v - lag * a, a
