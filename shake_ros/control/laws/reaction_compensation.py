"""Feedforward PI control (6.40) with compensation of a specimen's reaction force on the table.

    u = u_PI − Ḟ_c/(M β_3),  F = m (2ζω ż + ω² z) + m â,  z̈ + 2ζω ż + ω² z = −â,  Ḟ_c = ω_c (F − F_c)

A specimen of mass m on a spring pulls at the table with m (2ζω ż + ω² z) instead of the −m â of a mass that is bolted
to it. The difference F disturbs ẍ of the reduced model (6.33)–(6.35) by Ḟ/M per second, which a command of
−Ḟ/(M β_3) takes away; ω_c is the low-pass without which the derivative carries the noise. Horiuchi measured the
force; here a model of the specimen under the estimated acceleration gives it, exact for an acceleration that runs
straight between samples. Surveyed in 5.1.2 (Horiuchi, Seki). Verified against: the specimen's closed-form response; a
table with a specimen, with and without compensation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.control.laws import feedforward_pi
from shake_ros.control.laws.law import advance
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class ReactionCompensation(feedforward_pi.PIGains):
    """Gains of (6.40), the specimen, and the table that it pulls at."""

    code: ClassVar[int] = 11
    states: ClassVar[int] = 6

    compensation: float = quantity("-", "share of the reaction that is compensated", low=0.0, high=1.5, live=True)
    compensation_corner: float = quantity("rad/s", "ω_c of the reaction's low-pass", low=1.0, high=2000.0, live=True)
    compensated_mass: float = quantity("kg", "mass m of the specimen that moves", low=0.0, high=1e6, live=True)
    compensated_frequency: float = quantity("rad/s", "ω of the specimen", low=1.0, high=1000.0, live=True)
    compensated_damping: float = quantity("-", "ζ of the specimen", low=0.0, high=0.99, live=True)
    moved_mass: float = quantity("kg", "mass M of table and specimen", low=1.0, high=1e6, live=True)
    beta3: float = quantity("m/s^3", "β_3, jerk per command", low=1e-6, live=True)


@njit
def carried(z, rate, before, now, frequency, damping, dt):  # type: ignore[no-untyped-def]
    """(z, ż) of the specimen after a sample in which the table's acceleration runs straight."""
    wish = -1.0 / (frequency * frequency)
    z, rate, _ = advance(z, rate, wish * before, wish * now, frequency, damping, dt)
    return z, rate


@njit
def reaction(p, z, rate, acceleration):  # type: ignore[no-untyped-def]
    """F: what the specimen does to the table beyond a mass that is bolted to it [N]."""
    omega = p.compensated_frequency
    return p.compensated_mass * (2.0 * p.compensated_damping * omega * rate + omega * omega * z + acceleration)


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; as in `feedforward_pi.step`, state (∫e [m·s], started, z [m], ż [m/s], â before [m/s²], F_c [N])."""
    now = estimate[2]
    z, rate, smooth, command = 0.0, 0.0, 0.0, feedforward
    if state[1] != 0.0:
        z, rate = carried(state[2], state[3], state[4], now, p.compensated_frequency, p.compensated_damping, dt)
        force = reaction(p, z, rate, now)
        smooth = force + (state[5] - force) * math.exp(-p.compensation_corner * dt)
        slope = p.compensation_corner * (force - smooth)
        command = feedforward - p.compensation * slope / (p.moved_mass * p.beta3)
    else:
        smooth = reaction(p, z, rate, now)
    integral, u = feedforward_pi.step(state[:1], p, reference, estimate, command, dt)
    following = np.empty(6)
    following[0], following[1], following[2] = integral[0], 1.0, z
    following[3], following[4], following[5] = rate, now, smooth
    return following, u
