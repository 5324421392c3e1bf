"""Linear-quadratic regulator with integral action: u = K_ff ẋ_ref + K_aff ẍ_ref − k_I ∫e − k_P e_1 − k_V e_2 − k_A e_3.

The error e = x̂ − x_ref of the reduced model (6.33)–(6.35) under its feedforward obeys ė_3 = β_1 e_2 + β_2 e_3 + β_3 u.
`optimal` gives the gains that minimise Σ q_I (∫e)² + q_P e_1² + q_V e_2² + q_A e_3² + r u² over the samples, each
weight one over the square of a deviation that counts as much as a command of one; the command that acts a sample late
is a state of the design. The integral stops while the command is saturated and it pushes further. Surveyed in 5.1.2
(Kuehn; Nakata's acceleration tracking). Verified against: the difference equation by hand; the cost of simulated runs
with other gains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from shake_ros.compiled import njit
from shake_ros.control.laws import feedforward_pi
from shake_ros.control.laws.law import LawParameters
from shake_ros.quantities import quantity


@dataclass(frozen=True, kw_only=True)
class LinearQuadratic(LawParameters):
    """Gains of the error's state feedback, and of the model's inverse in front of it."""

    code: ClassVar[int] = 8
    states: ClassVar[int] = 1

    proportional_gain: float = quantity("1/m", "−k_P, command per position error", high=0.0, live=True)
    integral_gain: float = quantity("1/(m s)", "−k_I, command per integrated position error", high=0.0, live=True)
    velocity_gain: float = quantity("s/m", "−k_V, command per velocity error", live=True)
    acceleration_gain: float = quantity("s^2/m", "−k_A, command per acceleration error", live=True)
    feedforward_gain: float = quantity("s/m", "K_ff, command per reference velocity", low=0.0, live=True)
    feedforward_acceleration: float = quantity("s^2/m", "K_aff, command per reference acceleration", live=True)


def error_model(beta: Sequence[float], dt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """State (∫e, e_1, e_2, e_3, last command) after a sample, (5, 5) and (5,): the command acts a sample late.

    beta : β_1, β_2, β_3.
    """
    rates = np.zeros((5, 5))
    rates[0, 1] = rates[1, 2] = rates[2, 3] = 1.0
    rates[3, 2:] = beta[0], beta[1], beta[2]
    matrix, column = expm(rates * dt), np.zeros(5)
    matrix[4], column[4] = 0.0, 1.0
    return matrix, column


def optimal(beta: Sequence[float], deviations: Sequence[float], dt: float) -> NDArray[np.float64]:
    """k_I, k_P, k_V, k_A and the share of the last command, (5,).

    Parameters
    ----------
    beta : β_1, β_2, β_3 of the reduced model.
    deviations : ∫e [m·s], e_1 [m], e_2 [m/s], e_3 [m/s²] that each count as much as a command of one.
    dt : sample time [s].
    """
    matrix, column = error_model(beta, dt)
    weights = np.diag([*(1.0 / np.square(deviations)), 1e-9])
    cost = solve_discrete_are(matrix, column[:, None], weights, np.eye(1))
    onto = column @ cost
    return np.asarray(onto @ matrix / (1.0 + onto @ column))


@njit
def feedforward(p, reference):  # type: ignore[no-untyped-def]
    """K_ff ẋ_ref + K_aff ẍ_ref [-]."""
    return p.feedforward_gain * reference[1] + p.feedforward_acceleration * reference[2]


@njit
def step(state, p, reference, estimate, feedforward, dt):  # type: ignore[no-untyped-def]
    """One sample; as in `feedforward_pi.step`, whose integral it is."""
    back = p.velocity_gain * (estimate[1] - reference[1]) + p.acceleration_gain * (estimate[2] - reference[2])
    return feedforward_pi.step(state, p, reference, estimate, feedforward + back, dt)
