"""Feedforward PI control (6.40), (6.41): u = K_P e + K_I ∫e + K_ff ẋ_ref with e = x̂ − x_ref.

With this sign of e the feedback gains are negative (table 6.13). K_ff is near |β_1|/β_3, the inverse of the velocity
gain. Verified against: the difference equation by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from shake_ros.compiled import njit
from shake_ros.control.laws.law import LawParameters, saturate, winds_up
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class PIGains(LawParameters):
    """The gains of table 6.13; laws that derive from it have the feedforward as well."""

    proportional_gain: float = quantity("1/m", "K_P, command per position error", high=0.0, live=True)
    integral_gain: float = quantity("1/(m s)", "K_I, command per integrated position error", high=0.0, live=True)
    feedforward_gain: float = quantity("s/m", "K_ff, command per reference velocity", low=0.0, live=True)


@dataclass(frozen=True, kw_only=True)
class FeedforwardPI(PIGains):
    """The law by itself."""

    code: ClassVar[int] = 1
    states: ClassVar[int] = 1


@njit
def feedforward(p, reference):  # type: ignore[no-untyped-def]
    """K_ff ẋ_ref of (6.40) [-]."""
    return p.feedforward_gain * reference[1]


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample.

    Parameters
    ----------
    state : (1,) array, ∫e [m·s]
    p : record of the law
    reference, estimate : (3,) arrays, position [m], velocity [m/s], acceleration [m/s²]
    feedforward : its part of the command [-]
    dt : sample time [s]

    Returns
    -------
    state : new array
    u : command within ±limit [-]
    """
    limit = p.limit
    error = estimate[0] - reference[0]  # (6.41)
    integral = state[0] + error * dt
    command = p.proportional_gain * error + p.integral_gain * integral + feedforward  # (6.40)
    if winds_up(command, limit, p.integral_gain * error):
        integral = state[0]
        command = p.proportional_gain * error + p.integral_gain * integral + feedforward
    following = np.empty(1)
    following[0] = integral
    return following, saturate(command, limit)
