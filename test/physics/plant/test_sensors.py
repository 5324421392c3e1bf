"""Sensors: the noise's size, its independence, its repeatability, and the converter's steps."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.physics.plant.parameters import SensorParameters
from shake_ros.physics.plant.sensors import SensorNoise
from shake_ros.quantities import ShakeError

PARAMETERS = SensorParameters(
    position_noise=8e-6, position_range=0.3, position_bits=16, acceleration_noise=0.05, pressure_noise=2e4
)
SMOOTH = PARAMETERS.replace(position_bits=0)


def readings(parameters: SensorParameters, seed: int, count: int = 20000) -> np.ndarray:
    noise = SensorNoise(parameters, seed)
    return np.array([noise.read(k, 0.01, 1.0, 8e6, 9e6, 2e7) for k in range(count)])


def test_noise_has_the_stated_deviation_no_mean_and_no_correlation() -> None:
    deviation = (readings(SMOOTH, 3) - [0.01, 1.0, 8e6, 9e6, 2e7]) / [8e-6, 0.05, 2e4, 2e4, 2e4]
    count = len(deviation)
    np.testing.assert_allclose(deviation.std(axis=0), 1.0, atol=4.0 / np.sqrt(2.0 * count))
    np.testing.assert_allclose(deviation.mean(axis=0), 0.0, atol=4.0 / np.sqrt(count))
    across = np.corrcoef(deviation.T) - np.eye(5)
    along = [np.corrcoef(d[1:], d[:-1])[0, 1] for d in deviation.T]
    assert np.max(np.abs(across)) < 4.0 / np.sqrt(count)
    assert np.max(np.abs(along)) < 4.0 / np.sqrt(count)


def test_noise_of_a_sample_depends_on_seed_and_sample_alone() -> None:
    forwards, noise = readings(PARAMETERS, 7, 9000), SensorNoise(PARAMETERS, 7)
    for k in (8999, 0, 4095, 4096, 4095):
        assert noise.read(k, 0.01, 1.0, 8e6, 9e6, 2e7) == tuple(forwards[k])
    assert not np.array_equal(forwards[:, 1], readings(PARAMETERS, 8, 9000)[:, 1])


def test_position_comes_in_steps_of_the_converter() -> None:
    step = 0.3 / 2**16
    positions = readings(PARAMETERS, 1, 2000)[:, 0]
    np.testing.assert_allclose(positions / step, np.round(positions / step), atol=1e-6)
    assert len(np.unique(positions)) > 3


@pytest.mark.parametrize(("place", "seen"), [(1.0, 0.15), (-1.0, -0.15)])
def test_position_ends_at_the_measuring_range(place: float, seen: float) -> None:
    assert SensorNoise(SMOOTH, 0).read(0, place, 0.0, 0.0, 0.0, 0.0)[0] == seen


def test_without_noise_and_steps_the_sensors_read_the_truth() -> None:
    ideal = SMOOTH.replace(position_noise=0.0, acceleration_noise=0.0, pressure_noise=0.0)
    assert SensorNoise(ideal, 5).read(11, 0.0123, -2.0, 1e6, 2e6, 3e6) == (0.0123, -2.0, 1e6, 2e6, 3e6)


def test_a_negative_seed_is_refused_by_its_name() -> None:
    with pytest.raises(ShakeError, match="seed = -1 is negative"):
        SensorNoise(PARAMETERS, -1)
