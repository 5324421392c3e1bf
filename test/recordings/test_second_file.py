"""Two clocks from one motion: known shift and drift of closed-form motions, and motions that do not tell."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.recordings.second_file import EvenSamples, clock_of

FREQUENCIES = np.random.default_rng(3).uniform(1.5, 12.0, 40)  # [Hz]
PHASES = np.random.default_rng(4).uniform(0.0, 2.0 * np.pi, 40)


def motion(time: np.ndarray, derivative: int = 0) -> np.ndarray:
    """A sum of sines or its second derivative."""
    w = 2.0 * np.pi * FREQUENCIES
    size = 1e-3 * (w**-1.0) * (-(w**2) if derivative else 1.0)
    return np.asarray(np.sin(np.outer(time, w) + PHASES) @ size)


def files(start: float, drift: float, noise: float = 0.0, sign: float = 1.0) -> tuple[EvenSamples, EvenSamples]:
    """A position at 256 Hz from 0 s, an acceleration at 480 Hz whose clock shows 100 s at `start`."""
    own = np.arange(0.0, 20.0, 1.0 / 480.0)
    felt = sign * motion(start + own * (1.0 + drift), 2)
    felt += noise * np.std(felt) * np.random.default_rng(5).standard_normal(len(own))
    return EvenSamples(0.0, 1.0 / 256.0, motion(np.arange(6144) / 256.0)), EvenSamples(100.0, 1.0 / 480.0, felt)


@pytest.mark.parametrize(("start", "drift"), [(1.2347, -50e-6), (-3.3, 120e-6)])
def test_shift_and_drift_of_a_clock_are_found(start: float, drift: float) -> None:
    found = clock_of(*files(start, drift))
    assert found.drift == pytest.approx(drift, abs=1e-6)
    assert found.on_first(np.array([100.0, 120.0])) == pytest.approx([start, start + 20.0 * (1.0 + drift)], abs=2e-5)
    assert found.correlation > 0.99
    assert not found.turned


def test_what_is_found_lies_within_its_deviations_under_noise() -> None:
    found = clock_of(*files(1.0, -50e-6, noise=0.5))
    assert found.drift == pytest.approx(-50e-6, abs=3.0 * found.drift_deviation)
    assert found.on_first(np.array([100.0]))[0] == pytest.approx(1.0, abs=3.0 * found.shift_deviation)
    assert found.shift_deviation < 1e-3


def test_accelerometer_that_points_the_other_way_tells_the_same() -> None:
    found = clock_of(*files(1.0, 0.0, sign=-1.0))
    assert found.turned
    assert found.on_first(np.array([100.0]))[0] == pytest.approx(1.0, abs=2e-5)


def test_sine_does_not_tell() -> None:
    time = np.arange(5000) / 250.0
    with pytest.raises(ShakeError, match="periodic motion"):
        clock_of(EvenSamples(0.0, 0.004, np.sin(12.0 * time)), EvenSamples(0.0, 0.004, -np.sin(12.0 * time + 1.0)))


def test_another_motion_is_refused() -> None:
    other = np.random.default_rng(6).standard_normal(9600)
    with pytest.raises(ShakeError, match="did not record the same motion"):
        clock_of(files(0.0, 0.0)[0], EvenSamples(0.0, 1.0 / 480.0, other))
