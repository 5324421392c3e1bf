"""Sliding-mode control (6.43)–(6.49), as derived.

S = K_s1 ∫e_1 + K_s2 e_1 + K_s3 e_2 + K_s4 e_3 with e = ẑ − reference. Demanding Ṡ = −K_s tanh(α_1 S) of the
reduced model gives (6.48)

    u = [−K_s1 e_1 − (K_s2 + K_s4 β_1) e_2 − (K_s3 + K_s4 β_2) e_3 − K_s4 F − K_s tanh(α_1 S)] / (K_s4 β_3)
    F = β_1 ẋ_ref + β_2 ẍ_ref + |u| (β_4 z_3 + β_5 z_2)

in which the print drops the factor K_s4 of F and has α_2 for |u|; the reference's jerk is left out. |u| stands on both
sides: u β_3 + |u| G = N has the one solution u = N/(β_3 + sgn(N) G), G = β_4 z_3 + β_5 z_2.
Under a model feedforward the table's losses are in that model, and G is left out.

Verified against: Ṡ = −K_s tanh(α_1 S) on the reduced model itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.control.laws.law import LawParameters, saturate, winds_up
from shake_ros.physics.plant.reduced import ReducedParameters
from shake_ros.quantities import quantity

LEAST_GAIN = 0.2  # share of β_3 below which β_3 ± G is not let fall, so that the division stays sound


@dataclass(frozen=True, kw_only=True)
class SlidingMode(LawParameters, ReducedParameters):
    """The reduced model's β and the gains of table 6.14."""

    code: ClassVar[int] = 2
    states: ClassVar[int] = 1

    surface_integral: float = quantity("1/s", "K_s1, weight of the integrated position error", low=0.0, live=True)
    surface_position: float = quantity("-", "K_s2, weight of the position error", low=0.0, live=True)
    surface_velocity: float = quantity("s", "K_s3, weight of the velocity error", low=0.0, live=True)
    surface_acceleration: float = quantity("s^2", "K_s4, weight of the acceleration error", low=1e-9, live=True)
    reaching_gain: float = quantity("m/s", "K_s, rate towards the surface", low=0.0, live=True)
    reaching_slope: float = quantity("1/m", "α_1, steepness of the tanh that approximates the sign", low=0.0, live=True)

    def under_model(self) -> SlidingMode:
        """Without G: the table's losses are in the model."""
        return self.replace(beta4=0.0, beta5=0.0)


@njit
def feedforward(p, reference):  # type: ignore[no-untyped-def]
    """−(β_1 ẋ_ref + β_2 ẍ_ref)/β_3, the reference's part of (6.49) [-]."""
    return -(p.beta1 * reference[1] + p.beta2 * reference[2]) / p.beta3


@njit
def command_of(integral, p, error, loss, feedforward):  # type: ignore[no-untyped-def]
    """The unlimited command of (6.48) for an integral of the position error."""
    k1, k2, k3, k4 = p.surface_integral, p.surface_position, p.surface_velocity, p.surface_acceleration
    beta1, beta2, beta3 = p.beta1, p.beta2, p.beta3
    surface = k1 * integral + k2 * error[0] + k3 * error[1] + k4 * error[2]  # (6.46)
    # (6.48), before |u| is resolved
    demand = -k1 * error[0] - (k2 + k4 * beta1) * error[1] - (k3 + k4 * beta2) * error[2]
    demand = (demand - p.reaching_gain * math.tanh(p.reaching_slope * surface)) / k4 + beta3 * feedforward
    gain = beta3 + (loss if demand > 0.0 else -loss)
    return demand / max(gain, LEAST_GAIN * beta3)


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; arguments and results as in `feedforward_pi.step`, state ∫e_1 [m·s]."""
    limit = p.limit
    error = estimate - reference  # (6.44)
    loss = p.beta4 * estimate[2] + p.beta5 * estimate[1]  # G of (6.49)
    integral = state[0] + error[0] * dt
    command = command_of(integral, p, error, loss, feedforward)
    if winds_up(command, limit, -error[0]):
        integral = state[0]
        command = command_of(integral, p, error, loss, feedforward)
    following = np.empty(1)
    following[0] = integral
    return following, saturate(command, limit)
