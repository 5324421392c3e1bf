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

from shake_ros.core.compiled import njit
from shake_ros.core.control import minimal_control_synthesis, three_variable
from shake_ros.core.control.law import LawParameters, free_motion
from shake_ros.core.quantities import quantity

INNER = 4  # states of three-variable control; then the model's distance from the reference, its rate, the integrals
STATES = INNER + 2 + minimal_control_synthesis.ADAPTED


@dataclass(frozen=True, kw_only=True)
class FeedforwardMinimalControl(LawParameters):
    """The adaptive part and the three-variable control under it."""

    code: ClassVar[int] = 10
    states: ClassVar[int] = STATES

    adaptation_integral: float = quantity("1/m", "alpha, weight of the integrated adaptation", low=0.0, live=True)
    adaptation_proportional: float = quantity("s/m", "beta, weight of the direct adaptation", low=0.0, live=True)
    velocity_weight: float = quantity("-", "c, weight of the velocity error in e_y", low=0.0, live=True)
    leakage: float = quantity("1/s", "sigma, rate at which adaptive gains fade", low=0.0, live=True)
    gain_limit: float = quantity("-", "bound on every adaptive gain", low=0.0, live=True)
    model_frequency: float = quantity("rad/s", "omega_m of the reference model", low=0.1, high=1000.0, live=True)
    model_damping: float = quantity("-", "xi_m of the reference model", low=0.05, high=0.99, live=True)
    filter_frequency: float = quantity("rad/s", "ω_f of the input filter, 0 for none", low=0.0, high=2000.0, live=True)
    filter_damping: float = quantity("-", "ξ_f of the input filter", low=0.05, high=0.99, live=True)
    reference_displacement: float = quantity("1/m", "K_dr, command per reference position", low=0.0, live=True)
    reference_velocity: float = quantity("s/m", "K_vr, command per reference velocity", live=True)
    reference_acceleration: float = quantity("s^2/m", "K_ar, command per reference acceleration", live=True)
    feedback_displacement: float = quantity("1/m", "K_df, minus the command per position", low=0.0, live=True)
    feedback_velocity: float = quantity("s/m", "K_vf, minus the command per velocity", live=True)
    feedback_acceleration: float = quantity("s^2/m", "K_af, minus the command per acceleration", live=True)

    def under_model(self) -> FeedforwardMinimalControl:
        """Inner loop with T = S and no filter, as three-variable control by itself."""
        return self.replace(
            filter_frequency=0.0,
            reference_displacement=self.feedback_displacement,
            reference_velocity=self.feedback_velocity,
            reference_acceleration=self.feedback_acceleration,
        )


@njit
def feedforward(p, reference):  # type: ignore[no-untyped-def]
    """None outside `step`: T acts behind the filter, which has a state."""
    return 0.0


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
