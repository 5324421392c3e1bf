"""Shaping that every reference shares: soft start and stop, the filter (5.1), the time of a live change.

The filter ẍ + 2ξ_f ω_f ẋ + ω_f² x = ω_f² r makes (x, ẋ, ẍ)_ref of a wish r.

Discretised exactly for an input that is linear between samples: the state is advanced by the matrix
exponential, so the result is the solution of the differential equation at the sampling instants, whatever
the sample time, and stable for every damping above zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from shake_ros.core.compiled import njit
from shake_ros.core.quantities import Parameters, ShakeError, quantity
from shake_ros.core.reference.motion import Array, columns, product, smooth_step


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


@dataclass(frozen=True)
class Shaping(Parameters):
    soft_start: float = quantity("s", "time of the C² ramp at the start; 0 = none", low=0.0, high=60.0)
    soft_stop: float = quantity("s", "time of the C² ramp at the end; 0 = none", low=0.0, high=60.0)
    change_time: float = quantity("s", "time over which a live change is faded in", low=0.1, high=60.0)
    filter_frequency: float = quantity("rad/s", "ω_f of the reference filter (5.1); 0 = no filter", low=0.0, high=1e4)
    filter_damping: float = quantity("-", "ξ_f of the reference filter (5.1)", low=0.1, high=10.0)


def window(time: Array, soft_start: float, soft_stop: float) -> tuple[Array, Array, Array]:
    """A window from 0 up to 1 and back to 0 with its first two derivatives by time; each of shape (n,).

    Raises ShakeError where start and stop overlap.
    """
    end = float(time[-1])
    if soft_start + soft_stop > end * (1.0 + 1e-9):
        raise ShakeError(
            f"reference: soft_start {soft_start:g} s + soft_stop {soft_stop:g} s exceed its length {end:g} s"
        )
    one = (np.ones_like(time), np.zeros_like(time), np.zeros_like(time))
    up, down = one, one
    if soft_start > 0.0:
        value, slope, curvature = smooth_step(time / soft_start)
        up = (value, slope / soft_start, curvature / soft_start**2)
    if soft_stop > 0.0:
        value, slope, curvature = smooth_step((end - time) / soft_stop)
        down = (value, -slope / soft_stop, curvature / soft_stop**2)
    return columns(product(up, down))


def shape(states: Array, shaping: Shaping, sample_time: float) -> Array:
    """Rows of shape (n, 3) with soft start and stop, then filtered; longer by the filter's settling time."""
    time: Array = np.arange(len(states), dtype=np.float64) * sample_time
    if shaping.soft_start > 0.0 or shaping.soft_stop > 0.0:
        states = product(columns(states), window(time, shaping.soft_start, shaping.soft_stop))
    if shaping.filter_frequency > 0.0:
        settle = settling_time(shaping.filter_frequency, shaping.filter_damping)
        wish = np.append(states[:, 0], np.full(int(np.ceil(settle / sample_time)), states[-1, 0]))
        states = apply(wish, shaping.filter_frequency, shaping.filter_damping, sample_time)
        states[-1, 1:] = 0.0
    return states
