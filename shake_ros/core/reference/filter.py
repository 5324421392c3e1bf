"""Reference filter (5.1): ẍ + 2ξ_f ω_f ẋ + ω_f² x = ω_f² r, from a wish r to (x, ẋ, ẍ)_ref.

Discretised exactly for an input that is linear between samples: the state is advanced by the matrix
exponential, so the result is the solution of the differential equation at the sampling instants, whatever
the sample time, and stable for every damping above zero.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from shake_ros.core.compiled import njit
from shake_ros.core.reference.motion import Array


def discretise(frequency: float, damping: float, sample_time: float) -> tuple[Array, Array, Array]:
    """Transition of the state s = (x, ẋ): s' = transition s + before r_k + after r_{k+1}.

    Parameters
    ----------
    frequency : ω_f [rad/s].
    damping : ξ_f [-].
    sample_time : [s].

    Returns
    -------
    transition (2, 2), before (2,), after (2,)
    """
    w, h = frequency, sample_time
    generator = np.zeros((4, 4))  # state x, ẋ, input r, increment of r over one sample
    generator[0, 1] = 1.0
    generator[1] = (-(w**2), -2.0 * damping * w, w**2, 0.0)  # (5.1)
    generator[2, 3] = 1.0 / h
    step = np.asarray(expm(generator * h), dtype=np.float64)
    after = step[:2, 3]
    return step[:2, :2].copy(), step[:2, 2] - after, after.copy()


@njit
def _run(wish, frequency, damping, transition, before, after):  # type: ignore[no-untyped-def]
    states = np.zeros((wish.size, 3))
    x, v = wish[0], 0.0
    for k in range(wish.size):
        if k > 0:
            r, s = wish[k - 1], wish[k]
            x, v = (
                transition[0, 0] * x + transition[0, 1] * v + before[0] * r + after[0] * s,
                transition[1, 0] * x + transition[1, 1] * v + before[1] * r + after[1] * s,
            )
        states[k, 0] = x
        states[k, 1] = v
        states[k, 2] = frequency**2 * (wish[k] - x) - 2.0 * damping * frequency * v  # (5.1)
    return states


def apply(wish: Array, frequency: float, damping: float, sample_time: float) -> Array:
    """(x, ẋ, ẍ)_ref of shape (n, 3) for the wish r of shape (n,) [m], from rest at its first value."""
    parts = discretise(frequency, damping, sample_time)
    return np.asarray(_run(np.ascontiguousarray(wish, dtype=np.float64), frequency, damping, *parts))


def settling_time(frequency: float, damping: float) -> float:
    """Time [s] after which the filter's transient has decayed to e⁻²⁰ of its start."""
    slowest = damping - np.sqrt(damping**2 - 1.0) if damping > 1.0 else damping
    return float(20.0 / (frequency * slowest))
