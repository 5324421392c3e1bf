"""Levant's robust exact differentiator in a proper implicit discretisation: from position alone, without any model.

    ẋ_i = x_{i+1} + k_i |σ|^{(n−i)/(n+1)} sgn σ,  ẋ_n = k_n sgn σ,  σ = y − x_0,  k_i = λ_i L^{(i+1)/(n+1)}

Every term is taken at the sample's end. The chain of backward Euler steps folds into one monotone inclusion in σ,

    σ + Σ_{i<n} h^{i+1} k_i |σ|^{(n−i)/(n+1)} sgn σ + h^{n+1} k_n Sgn σ ∋ y − Σ_i h^i x_i,

which has exactly one solution: σ = 0 where the right-hand side is within h^{n+1} k_n, and then the sign's value makes
up the rest, so nothing chatters; else a root in |σ|^{1/(n+1)} of an increasing convex polynomial, by Newton's method
from above. On σ = 0 the states are the backward differences of the measurement, x_i = ∇^i y / h^i, which lag. The
outputs are the combinations of them that are exact on polynomials up to degree n, from D = −ln(1 − ∇)/h:

    ẏ = x_1 + h/2 x_2 + h²/3 x_3,  ÿ = x_2 + h x_3.

Sources: A. Levant, International Journal of Control 76 (2003), 924–941, with his gains; R. Seeber, Proper implicit
discretization of arbitrary-order robust exact differentiators, arXiv 2404.02770 (2024), whose idea it is to take the
outputs as combinations of the states. The combinations here were derived anew from the backward differences.

Range of validity: |y^{(n+1)}| ≤ L. Verified against: polynomials; a finely stepped explicit solution; the best bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.observer.law import ObserverParameters
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import quantity

GAINS = {2: (2.0, 2.12, 1.1), 3: (3.0, 4.16, 3.06, 1.1)}  # λ_0 … λ_n of Levant's non-recursive form
ITERATIONS = 60


@dataclass(frozen=True)
class RobustExactDifferentiator(ObserverParameters):
    """Order and bound of the highest derivative."""

    code: ClassVar[int] = 4
    derived: ClassVar[tuple[str, ...]] = ("k0", "k1", "k2", "k3")

    order: int = quantity("-", "order n: 2 differentiates up to the acceleration, 3 up to the jerk", low=2, high=3)
    highest_derivative: float = quantity(
        "m/s^(n+1)", "L, bound of the derivative n + 1: of the jerk at n = 2, of its rate at n = 3", low=1e-3
    )

    def derive(self, sample_time: float, model: TableParameters | None) -> dict[str, float]:
        """k_0 … k_n, zero behind."""
        n, bound = self.order, self.highest_derivative
        gains = [gain * bound ** ((i + 1.0) / (n + 1.0)) for i, gain in enumerate(GAINS[n])]
        return dict(zip(self.derived, gains, strict=False))

    def started(
        self, estimate: NDArray[np.float64], command: float, sample_time: float, model: TableParameters | None
    ) -> NDArray[np.float64]:
        """The state (4,) whose outputs are the estimate, with no jerk: x_1 = v − h a/2."""
        position, velocity, acceleration = estimate
        return np.array([position, velocity - 0.5 * sample_time * acceleration, acceleration, 0.0])


def worst_case(noise: float, highest_derivative: float, sample_time: float) -> float:
    """Smallest bound on the velocity error that any exact differentiator can promise, 2√(2NL) + LΔ/2 [m/s].

    Parameters
    ----------
    noise : N, largest error of a position sample [m]
    highest_derivative : L, bound of the acceleration [m/s²]
    sample_time : Δ [s]

    Examples
    --------
    >>> worst_case(2e-6, 4.0, 1e-3)  # 2·√16e-6 + 2e-3
    0.01
    """
    return 2.0 * math.sqrt(2.0 * noise * highest_derivative) + 0.5 * highest_derivative * sample_time


@njit
def error_root(n, gains, rest, h):  # type: ignore[no-untyped-def]
    """s = |σ|^{1/(n+1)} > 0 with s^{n+1} + Σ h^{i+1} k_i s^{n−i} = rest, for rest > h^{n+1} k_n."""
    s = rest ** (1.0 / (n + 1.0))
    for _ in range(ITERATIONS):
        value, slope, power = 1.0, 0.0, h
        for i in range(n + 1):  # Horner, from s^{n+1} down
            slope = slope * s + value
            value = value * s + gains[i] * power
            power *= h
        following = s - (value - rest) / slope
        if not following < s:
            break
        s = max(following, 0.0)
    return s


@njit
def observe(state, p, model, measured, command, dt, work, estimate):  # type: ignore[no-untyped-def]
    """One sample, in place; arguments as in `sliding_mode.observe`, with a (4,) state; the command is not used."""
    n = int(p.order)
    gains = (p.k0, p.k1, p.k2, p.k3)
    rest, power = measured[0], 1.0
    for i in range(n + 1):
        rest -= power * state[i]
        power *= dt
    push, root = rest, 0.0  # push: h^{n+1} k_n ξ
    largest = power * gains[n]
    if abs(rest) > largest:
        push = math.copysign(largest, rest)
        root = error_root(n, gains, abs(rest), dt)
    state[n] += push / (power / dt)
    for i in range(n - 1, -1, -1):
        state[i] += dt * (state[i + 1] + math.copysign(gains[i] * root ** (n - i), rest))
    estimate[0] = state[0]
    estimate[1] = state[1] + dt * (state[2] / 2.0 + dt * state[3] / 3.0)
    estimate[2] = state[2] + dt * state[3]
