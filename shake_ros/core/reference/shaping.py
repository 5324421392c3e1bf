"""Shaping that every reference shares: soft start and stop, the filter (5.1), the time of a live change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, ShakeError, quantity
from shake_ros.core.reference import filter as reference_filter
from shake_ros.core.reference.motion import Array, columns, product, smooth_step


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
        settle = reference_filter.settling_time(shaping.filter_frequency, shaping.filter_damping)
        wish = np.append(states[:, 0], np.full(int(np.ceil(settle / sample_time)), states[-1, 0]))
        states = reference_filter.apply(wish, shaping.filter_frequency, shaping.filter_damping, sample_time)
        states[-1, 1:] = 0.0
    return states
