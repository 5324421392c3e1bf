"""Sensors: noise and quantisation as a function of seed and sample alone, and the filter behind the accelerometer.

The anti-aliasing filter between accelerometer and recorder is a Butterworth low-pass of second order,

    z̈ + √2 ω_c ż + ω_c² z = ω_c² a

It belongs to a recording, not to the table. With each step of the integration it is advanced exactly for the parabola
through the acceleration at both ends that has the acceleration's mean in between, which is the change of the velocity:
where friction reverses, the acceleration jumps within a sample, and the integration takes short steps.
Verified against the same equation solved beside the table with steps of 1 % of a sample.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.physics.plant.parameters import SensorParameters
from shake_ros.physics.valve.simplified import motion_weights
from shake_ros.quantities import ShakeError

BLOCK = 4096  # samples of noise made at a time
CHANNELS = 5


def normal_draws(seed: int, samples: int) -> NDArray[np.float64]:
    """Standard normal draws of the first samples, (samples, CHANNELS), the same as `SensorNoise` takes one by one."""
    blocks = [_block(seed, i) for i in range(-(-samples // BLOCK))]
    return np.concatenate(blocks)[:samples] if blocks else np.zeros((0, CHANNELS))


def _block(seed: int, block: int) -> NDArray[np.float64]:
    generator = np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, 0, block]))
    return generator.standard_normal((BLOCK, CHANNELS))


class SensorNoise:
    """White Gaussian noise on position, acceleration and three pressures, and steps of the position converter.

    Sample k always draws the same noise for the same seed, in whatever order samples are asked for. A negative seed is
    a ShakeError.
    """

    def __init__(self, parameters: SensorParameters, seed: int) -> None:
        if seed < 0:
            raise ShakeError(f"seed = {seed} is negative")
        self.parameters = parameters
        self._seed = seed
        self._block = -1
        self._draws: list[list[float]] = []
        bits = parameters.position_bits
        self._step = parameters.position_range / 2**bits if bits else 0.0

    def _normal(self, k: int) -> list[float]:
        """Standard normal draws of sample k, one per channel."""
        block, place = divmod(k, BLOCK)
        if block != self._block:
            self._draws = _block(self._seed, block).tolist()
            self._block = block
        return self._draws[place]

    def read(
        self, k: int, position: float, acceleration: float, pressure_a: float, pressure_b: float, pressure_supply: float
    ) -> tuple[float, float, float, float, float]:
        """Sensor readings of sample k from what the sensors see: [m], [m/s²], [Pa] ×3."""
        s, n = self.parameters, self._normal(k)
        x = position + s.position_noise * n[0]
        if self._step > 0.0:
            x = round(x / self._step) * self._step
        half = 0.5 * s.position_range
        return (
            min(max(x, -half), half),
            acceleration + s.acceleration_noise * n[1],
            pressure_a + s.pressure_noise * n[2],
            pressure_b + s.pressure_noise * n[3],
            pressure_supply + s.pressure_noise * n[4],
        )


FILTER_DELAY = math.sqrt(0.5) / math.pi  # of slow signals, times the cut-off: √2/ω_c [-]
FILTER_DAMPING = math.sqrt(0.5)
SHORT = 1e-3  # phase of the filter in a step, below which the step's mean is lost in rounding
OMEGA, OUTPUT, RATE, INPUT = range(4)  # ω_c [1/s], 0 without a filter; z, ż and a [m/s²] of the filter's row


@njit
def begin_filter(row, cutoff, now):  # type: ignore[no-untyped-def]
    """A filter at rest behind the acceleration of this instant [m/s²], in place; cutoff : [Hz], 0 without one."""
    row[OMEGA] = 2.0 * math.pi * cutoff
    row[OUTPUT], row[RATE], row[INPUT] = now, 0.0, now


@njit
def advance_filter(row, after, gain, h):  # type: ignore[no-untyped-def]
    """The filter a step `h` [s] later, in place; input at its end [m/s²], and what its integral gained by it [m/s]."""
    w, before = row[OMEGA], row[INPUT]
    # The input is before + slope t + bend t²
    bend = (3.0 * (before + after) - 6.0 * gain / h) / (h * h) if w * h > SHORT else 0.0
    slope = (after - before) / h - bend * h if h > 0.0 else 0.0
    drift = slope - 4.0 * FILTER_DAMPING * bend / w  # level + drift t + bend t² is a solution
    level = before - (2.0 * FILTER_DAMPING * drift + 2.0 * bend / w) / w
    a, b, c = motion_weights(w, FILTER_DAMPING, h)
    d, r = row[OUTPUT] - level, row[RATE] - drift
    row[OUTPUT] = level + (drift + bend * h) * h + a * d + b * r
    row[RATE] = drift + 2.0 * bend * h - w * w * b * d + c * r
    row[INPUT] = after
