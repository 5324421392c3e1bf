"""Minimal control synthesis (5.6)–(5.9) in the inner or the outer loop around feedforward PI control (6.40).

The adaptive signal is m = Φ y + Φ_r r (5.6) with y = (ω_m x̂, v̂) and r = (ω_m x_ref, ẋ_ref, ẍ_ref/ω_m), all in m/s, and

    Φ = ∫ α e_y y − σ Φ dt + β e_y y (5.7),  Φ_r likewise with r (5.8),  e_y = ω_m (x_m − x̂) + c (v_m − v̂) (5.9).

The reference model starts where the table is and closes on the reference: x_m − x_ref follows
ẍ + 2ξ_m ω_m ẋ + ω_m² x = 0, so that a perfect adaptation has no lag. The leakage σ and the bound on every adaptive gain
are not in the thesis nor in Stoten's law, whose gains drift under noise; adaptation also stops while the command is
saturated. Inner loop: m/V is added to the command of the PI law; outer loop: m/ω_m is added to its position reference,
V = 1 m/s. A stiff plant wants small weights.

Verified against: the difference equation by hand; adaptation to the velocity gain of an integrating plant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.control.laws.feedforward_pi import PIGains
from shake_ros.control.laws.law import LawParameters, free_motion, saturate, winds_up
from shake_ros.quantities import choice, quantity

ADAPTED = 5  # adaptive gains: two of the state, three of the reference
STATES = 4 + ADAPTED  # ∫e, started, the model's distance from the reference and its rate, the integrals of the gains
STRATEGIES = ("inner", "outer")
OUTER = 1  # place of that name


@dataclass(frozen=True, kw_only=True)
class Adaptation(LawParameters):
    """How adaptive gains follow (5.7), (5.8), and the reference model."""

    adaptation_integral: float = quantity("1/m", "alpha, weight of the integrated adaptation", low=0.0, live=True)
    adaptation_proportional: float = quantity("s/m", "beta, weight of the direct adaptation", low=0.0, live=True)
    velocity_weight: float = quantity("-", "c, weight of the velocity error in e_y", low=0.0, live=True)
    leakage: float = quantity("1/s", "sigma, rate at which adaptive gains fade", low=0.0, live=True)
    gain_limit: float = quantity("-", "bound on every adaptive gain", low=0.0, live=True)
    model_frequency: float = quantity("rad/s", "omega_m of the reference model", low=0.1, high=1000.0, live=True)
    model_damping: float = quantity("-", "xi_m of the reference model", low=0.05, high=0.99, live=True)


@dataclass(frozen=True, kw_only=True)
class MinimalControlSynthesis(Adaptation, PIGains):
    """The adaptive part and the fixed law under it."""

    code: ClassVar[int] = 7
    states: ClassVar[int] = STATES

    strategy: str = choice("where the adaptive signal goes: the command (inner) or the reference (outer)", STRATEGIES)


@njit
def regressors(reference, estimate, omega):  # type: ignore[no-untyped-def]
    """y and r of (5.6), (5,) [m/s]."""
    found = np.empty(ADAPTED)
    found[0], found[1] = omega * estimate[0], estimate[1]
    found[2], found[3], found[4] = omega * reference[0], reference[1], reference[2] / omega
    return found


@njit
def adapt(before, regressor, error, p, dt):  # type: ignore[no-untyped-def]
    """(integrals, m): the integrals of (5.7), (5.8) after a sample and the adaptive signal [m/s]."""
    alpha, beta, bound = p.adaptation_integral, p.adaptation_proportional, p.gain_limit
    fade = math.exp(-p.leakage * dt)
    integrals, signal = np.empty(ADAPTED), 0.0
    for i in range(ADAPTED):
        push = error * regressor[i]
        integrals[i] = max(-bound, min(bound, fade * before[i] + alpha * push * dt))
        gain = max(-bound, min(bound, integrals[i] + beta * push))  # (5.7), (5.8)
        signal += gain * regressor[i]  # (5.6)
    return integrals, signal


@njit
def fixed_command(shift, integral, p, reference, estimate, feedforward):  # type: ignore[no-untyped-def]
    """(6.40) with the position reference shifted [-]."""
    error = estimate[0] - reference[0] - shift
    return p.proportional_gain * error + p.integral_gain * integral + feedforward


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; arguments and results as in `feedforward_pi.step`, the state as under `STATES`."""
    limit, outer, omega = p.limit, p.strategy == OUTER, p.model_frequency
    away, rate = estimate[0] - reference[0], estimate[1] - reference[1]
    if state[1] != 0.0:
        away, rate = free_motion(state[2], state[3], omega, p.model_damping, dt)
    error = omega * (away + reference[0] - estimate[0])
    error += p.velocity_weight * (rate + reference[1] - estimate[1])  # (5.9)
    integrals, signal = adapt(state[4:], regressors(reference, estimate, omega), error, p, dt)
    shift = signal / omega if outer else 0.0
    inner = 0.0 if outer else signal
    push = estimate[0] - reference[0] - shift
    command = fixed_command(shift, state[0] + push * dt, p, reference, estimate, feedforward) + inner
    following = np.empty(STATES)
    following[0] = state[0] if winds_up(command, limit, p.integral_gain * push) else state[0] + push * dt
    following[1], following[2], following[3] = 1.0, away, rate
    following[4:] = state[4:] if abs(command) > limit else integrals
    return following, saturate(command, limit)
