"""PID control (5.2): u = K_P e + K_I ∫e + K_D ė with e = x_ref − x̂.

The derivative is ẋ_ref − v̂ of the observer, or the position error's own, filtered: K_D s/(1 + s/ω_d), exact for an
error that is linear between samples. The integral stops while the command is saturated and it pushes further.
Verified against: the difference equation by hand; the closed-form response of the filtered derivative to a ramp.
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
class PID(LawParameters):
    """Gains of (5.2); `derivative_bandwidth` of zero takes the derivative from the observer."""

    code: ClassVar[int] = 4
    states: ClassVar[int] = 4

    proportional_gain: float = quantity("1/m", "K_P, command per position error", low=0.0, live=True)
    integral_gain: float = quantity("1/(m s)", "K_I, command per integrated position error", low=0.0, live=True)
    derivative_gain: float = quantity("s/m", "K_D, command per velocity error", low=0.0, live=True)
    derivative_bandwidth: float = quantity(
        "rad/s", "of the filtered derivative, 0 for the observer's velocity", low=0.0, high=5000.0, live=True
    )


@njit
def filtered_derivative(before, error_before, error, bandwidth, dt):  # type: ignore[no-untyped-def]
    """d of ḋ = ω_d (ė − d) after a sample in which the error runs straight from `error_before` to `error`."""
    slope = (error - error_before) / dt
    return slope + (before - slope) * math.exp(-bandwidth * dt)


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; as in `feedforward_pi.step`, state (∫e [m·s], started, e [m] and d [m/s] of the sample before)."""
    limit = p.limit
    error = reference[0] - estimate[0]
    rate = reference[1] - estimate[1]
    if p.derivative_bandwidth > 0.0:
        rate = 0.0 if state[1] == 0.0 else filtered_derivative(state[3], state[2], error, p.derivative_bandwidth, dt)
    integral = state[0] + error * dt
    rest = p.proportional_gain * error + p.derivative_gain * rate + feedforward
    command = rest + p.integral_gain * integral  # (5.2)
    if winds_up(command, limit, p.integral_gain * error):
        integral = state[0]
        command = rest + p.integral_gain * integral
    following = np.empty(4)
    following[0], following[1], following[2], following[3] = integral, 1.0, error, rate
    return following, saturate(command, limit)
