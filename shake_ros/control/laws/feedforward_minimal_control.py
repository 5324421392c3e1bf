"""Feedforward minimal control synthesis around three-variable control (Stoten and Shimizu, 5.1.2).

Minimal control synthesis without its feedback: m = Φ_r r with r = (ω_m x_ref, ẋ_ref, ẍ_ref/ω_m), and Φ_r adapted by
(5.8), (5.9) as in `minimal_control_synthesis`, leakage and bound included. Three-variable control (5.3), (5.4) is the
inner loop: m/ω_m is added to its position wish. With no signal of the table in it, m closes no loop of its own but
through the slow gains. Verified against: the difference equation by hand; adaptation to the gain of an integrating
plant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.control.laws import minimal_control_synthesis, three_variable
from shake_ros.control.laws.law import free_motion

INNER = 4  # states of three-variable control; then the model's distance from the reference, its rate, the integrals
STATES = INNER + 2 + minimal_control_synthesis.ADAPTED


@dataclass(frozen=True, kw_only=True)
class FeedforwardMinimalControl(minimal_control_synthesis.Adaptation, three_variable.ThreeVariableGains):
    """The adaptive part and the three-variable control under it."""

    code: ClassVar[int] = 10
    states: ClassVar[int] = STATES


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; arguments and results as in `feedforward_pi.step`, the state as under `STATES`."""
    omega = p.model_frequency
    away, rate = estimate[0] - reference[0], estimate[1] - reference[1]
    if state[0] != 0.0:
        away, rate = free_motion(state[INNER], state[INNER + 1], omega, p.model_damping, dt)
    error = omega * (away + reference[0] - estimate[0])
    error += p.velocity_weight * (rate + reference[1] - estimate[1])
    seen = minimal_control_synthesis.regressors(reference, estimate, omega)
    seen[0], seen[1] = 0.0, 0.0  # Φ y is left out
    integrals, signal = minimal_control_synthesis.adapt(state[INNER + 2 :], seen, error, p, dt)
    wish = p.reference_displacement * signal / omega
    inner, u = three_variable.step(state[:INNER], p, reference, estimate, feedforward + wish, dt)
    following = np.empty(STATES)
    following[:INNER] = inner
    following[INNER], following[INNER + 1] = away, rate
    following[INNER + 2 :] = state[INNER + 2 :] if abs(u) >= p.limit else integrals
    return following, u
