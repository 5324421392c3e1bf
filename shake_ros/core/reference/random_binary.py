"""Pseudo-random binary signal: between two positions, in an order that a shift register of maximal length gives.

A register of n bits has a period of 2ⁿ − 1 chips whose autocorrelation is 1 at no lag and −1/(2ⁿ − 1) at every other:
flat up to about 0.44 over the chip's length. Changes are C² ramps within a chip. Surveyed in 4.2 for identification;
two levels do not show how a table bends with the amplitude, which is why the thesis prefers sines. Verified against:
that autocorrelation; the derivatives of its ramps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, ShakeError, quantity
from shake_ros.core.reference.motion import Array, EarthquakeRecord, Motion, sample_times, smooth_step


@dataclass(frozen=True)
class RandomBinaryParameters(Parameters):
    amplitude: float = quantity("m", "distance of both positions from the middle", low=-1.0, high=1.0, live=True)
    bits: int = quantity("-", "length n of the shift register", low=2, high=16)
    chip: float = quantity("s", "shortest time at a position, ramp included", low=1e-3, high=60.0)
    rise_time: float = quantity("s", "time of a ramp, at most a chip", low=0.0, high=60.0)
    periods: int = quantity("-", "number of periods of 2^n − 1 chips", low=1, high=1000)


def levels(bits: int) -> Array:
    """One period of ±1, (2ⁿ − 1,).

    >>> levels(3).tolist()
    [1.0, 1.0, 1.0, -1.0, 1.0, -1.0, -1.0]
    """
    from scipy.signal import max_len_seq  # slow to import, and only this reference needs it

    return np.asarray(2.0 * max_len_seq(bits)[0] - 1.0)


def motion(parameters: RandomBinaryParameters, sample_time: float, record: EarthquakeRecord | None = None) -> Motion:
    """The signal, whole periods, from rest in the middle to rest there; `record` is not used."""
    p = parameters
    if p.rise_time > p.chip:
        raise ShakeError(f"random_binary: rise_time {p.rise_time:g} s is longer than a chip of {p.chip:g} s")
    chips = np.tile(levels(p.bits), p.periods)
    stops = np.concatenate([[0.0], chips, [0.0]])  # level before the first chip, of each, and behind the last
    time = sample_times((len(chips) + 1) * p.chip, sample_time)
    chip = np.clip(np.floor(time / p.chip + 1e-9).astype(int), 0, len(chips))
    before, change = stops[chip], stops[chip + 1] - stops[chip]
    states = np.zeros((len(time), 3))
    if p.rise_time == 0.0:
        states[:, 0] = before + change
    else:
        value, slope, curvature = smooth_step((time - chip * p.chip) / p.rise_time)
        states[:, 0] = before + change * value
        states[:, 1] = change * slope / p.rise_time
        states[:, 2] = change * curvature / p.rise_time**2
    return Motion(p.amplitude * states, {"chips": len(chips)})
