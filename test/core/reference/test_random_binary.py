"""The pseudo-random binary signal: its order, its ramps, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.core.quantities import ShakeError
from shake_ros.core.reference.random_binary import RandomBinaryParameters, levels, motion

SIGNAL = RandomBinaryParameters(amplitude=0.01, bits=5, chip=0.2, rise_time=0.1, periods=2)


@pytest.mark.parametrize("bits", [2, 5, 9])
def test_a_period_is_correlated_with_itself_at_no_lag_alone(bits: int) -> None:
    period = levels(bits)
    count = 2**bits - 1
    assert len(period) == count
    correlation = np.fft.irfft(np.abs(np.fft.rfft(period)) ** 2, count) / count
    np.testing.assert_allclose(correlation, np.where(np.arange(count) == 0, 1.0, -1.0 / count), atol=1e-9)


def test_it_stands_at_its_two_positions_and_begins_and_ends_in_the_middle_at_rest() -> None:
    states = motion(SIGNAL, 1e-3).states
    stands = states[150 : 150 + 200 * 62 : 200, 0]  # late in every chip
    np.testing.assert_allclose(stands, 0.01 * np.tile(levels(5), 2), atol=1e-12)
    np.testing.assert_allclose(states[[0, -1]], 0.0, atol=1e-12)


def test_velocity_and_acceleration_are_the_derivatives_of_the_position() -> None:
    x, v, a = motion(SIGNAL, 1e-4).states.T
    assert np.max(np.abs(np.gradient(x, 1e-4) - v)) < 2e-3 * np.max(np.abs(v))
    assert np.max(np.abs(np.gradient(v, 1e-4) - a)) < 2e-2 * np.max(np.abs(a))


def test_a_ramp_longer_than_a_chip_is_refused() -> None:
    with pytest.raises(ShakeError, match="longer than a chip"):
        motion(SIGNAL.replace(rise_time=0.3), 1e-3)
