"""Sensors: noise and quantisation as a function of the seed and the sample alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.plant.parameters import SensorParameters
from shake_ros.core.quantities import ShakeError

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
