"""Feedforward PI control (6.40), (6.41): u = K_P e + K_I ∫e + K_ff ẋ_ref with e = x̂ − x_ref.

With this sign of e the feedback gains are negative (table 6.13). K_ff is near |β_1|/β_3, the inverse of the velocity
gain. Verified against: the difference equation by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.compiled import njit
from shake_ros.core.control.law import LawParameters, saturate, winds_up
from shake_ros.core.quantities import quantity

CODE = 1
STATES = 1


@dataclass(frozen=True, kw_only=True)
class FeedforwardPI(LawParameters):
    """The gains of table 6.13."""

    proportional_gain: float = quantity("1/m", "K_P, command per position error", high=0.0, live=True)
    integral_gain: float = quantity("1/(m s)", "K_I, command per integrated position error", high=0.0, live=True)
    feedforward_gain: float = quantity("s/m", "K_ff, command per reference velocity", low=0.0, live=True)


def pack(parameters: FeedforwardPI, model_feedforward: bool) -> NDArray[np.float64]:
    """(limit, K_P, K_I, K_ff) as an array."""
    p = parameters
    return np.array([p.limit, p.proportional_gain, p.integral_gain, p.feedforward_gain])


@njit
def feedforward(parameters, reference):  # type: ignore[no-untyped-def]
    """K_ff ẋ_ref of (6.40) [-]."""
    return parameters[3] * reference[1]


@njit
def step(state, parameters, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample.

    Parameters
    ----------
    state : (1,) array, ∫e [m·s]
    parameters : array from `pack`
    reference, estimate : (3,) arrays, position [m], velocity [m/s], acceleration [m/s²]
    feedforward : its part of the command [-]
    dt : sample time [s]

    Returns
    -------
    state : new array
    u : command within ±limit [-]
    """
    limit = parameters[0]
    error = estimate[0] - reference[0]  # (6.41)
    integral = state[0] + error * dt
    command = parameters[1] * error + parameters[2] * integral + feedforward  # (6.40)
    if winds_up(command, limit, parameters[2] * error):
        integral = state[0]
        command = parameters[1] * error + parameters[2] * integral + feedforward
    following = np.empty(1)
    following[0] = integral
    return following, saturate(command, limit)
