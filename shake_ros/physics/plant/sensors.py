"""Sensors: noise and quantisation as a function of seed and sample alone, and the filter behind the accelerometer.

The anti-aliasing filter between accelerometer and recorder is a Butterworth low-pass of second order,

    z̈ + √2 ω_c ż + ω_c² z = ω_c² a

It belongs to a recording, not to the table. From sample to sample it is advanced exactly for the parabola through the
acceleration at both ends that has the acceleration's mean in between, which is the change of the velocity: where
friction reverses the acceleration jumps within a sample, and the recorder sees neither the jump nor its instant.
Verified against the same equation solved beside the table with steps of 1 % of a sample.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from shake_ros.compiled import njit
from shake_ros.physics.plant.parameters import SensorParameters
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


Array = NDArray[np.float64]
NONE: Array = np.empty((0, 0))
FILTER_DELAY = math.sqrt(0.5) / math.pi  # of slow signals, times the cut-off: √2/ω_c [-]
OUTPUT, RATE = 0, 1  # of the filter's state
INPUTS = np.array([[1.0, 0.0, 0.0], [-4.0, -2.0, 6.0], [6.0, 6.0, -12.0]])  # ends and mean → value, rate, bend at 0


def filter_step(cutoff: float, dt: float) -> Array:
    """Rows of z and ż [1/s] after a sample, from z, ż, the input at both ends and its mean, shape (2, 5).

    cutoff : [Hz]; 0 is no filter, shape (0, 0). dt : [s].
    """
    if cutoff <= 0.0:
        return NONE
    w = 2.0 * math.pi * cutoff
    rates = np.zeros((5, 5))  # of z, ż and the input with its rate and bend per sample
    rates[0, 1] = dt
    rates[1] = [-w * w * dt, -math.sqrt(2.0) * w * dt, w * w * dt, 0.0, 0.0]
    rates[2, 3] = rates[3, 4] = 1.0
    after = expm(rates)[:2]
    return np.ascontiguousarray(np.hstack([after[:, :2], after[:, 2:] @ INPUTS]))


@njit
def advance_filter(step, z, before, after, mean):  # type: ignore[no-untyped-def]
    """The filter's state a sample later, in place; input at both ends and its mean [m/s²]."""
    output, rate = z[OUTPUT], z[RATE]
    for i in range(2):
        z[i] = step[i, 0] * output + step[i, 1] * rate + step[i, 2] * before + step[i, 3] * after + step[i, 4] * mean
