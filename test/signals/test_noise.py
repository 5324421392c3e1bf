"""Noise of a signal: from the band above its dynamics, and from the periods of a command that repeats."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from shake_ros.fit.records import Record
from shake_ros.signals.noise import periodic_deviation, repetition, samples_for_one, white_deviation

TIME = np.arange(5000) * 0.001


@pytest.mark.parametrize("deviation", [1e-5, 0.05, 7.0])
def test_white_noise_is_estimated_within_three_per_cent(deviation: float) -> None:
    values = deviation * np.random.default_rng(3).standard_normal(20000)
    assert white_deviation(values) == pytest.approx(deviation, rel=0.03)


def test_dynamics_below_the_sampling_rate_are_not_taken_for_noise() -> None:
    noise = 0.05 * np.random.default_rng(3).standard_normal(len(TIME))
    motion = 5.0 * np.sin(2.0 * np.pi * 10.0 * TIME) + 0.5 * np.sin(2.0 * np.pi * 40.0 * TIME)
    assert white_deviation(motion + noise) == pytest.approx(0.05, rel=0.05)


def test_jumps_of_the_friction_force_are_not_taken_for_noise() -> None:
    rng = np.random.default_rng(4)
    jumps = 2.0 * np.sign(np.sin(2.0 * np.pi * 8.0 * TIME + 0.3))
    impacts = np.where(rng.random(len(TIME)) < 0.01, 5.0, 0.0)
    noise = 0.05 * rng.standard_normal(len(TIME))
    assert white_deviation(jumps + impacts + noise) == pytest.approx(0.05, rel=0.3)
    assert np.std(np.diff(jumps + impacts + noise)) > 0.5


def repeated(periods: int = 6) -> np.ndarray:
    return np.tile(np.random.default_rng(2).standard_normal(500).cumsum() / 20.0, periods)


def test_a_command_repeats_only_if_it_does_so_to_the_last_digits_and_three_times() -> None:
    command = repeated()
    assert repetition(command) == 500
    assert repetition(command + 0.01 * np.random.default_rng(3).standard_normal(len(command))) is None
    assert repetition(repeated(2)) is None
    assert repetition(np.zeros(3000)) is None


def test_noise_that_is_not_white_is_found_from_the_periods_alone() -> None:
    command, rng = repeated(12), np.random.default_rng(5)
    slow = np.convolve(rng.standard_normal(len(command) + 49), np.ones(50) / np.sqrt(50.0), mode="valid")
    signal = 3.0 * command + slow
    found = periodic_deviation(signal, command)
    assert found == pytest.approx(1.0, rel=0.1)
    assert white_deviation(signal) < 0.5


def test_a_recording_takes_its_noise_from_the_periods_where_its_command_repeats() -> None:
    command, rng = repeated(12), np.random.default_rng(6)
    position = 1e-2 * np.cumsum(command - command.mean()) * 1e-3
    slow = np.convolve(rng.standard_normal(len(command) + 49), np.ones(50) / np.sqrt(50.0), mode="valid")
    record = Record("run", 1e-3, command, position, 0.2 * slow + command)
    assert record.acceleration_noise() == pytest.approx(0.2, rel=0.15)
    assert set(record.noise_from_periods) == {"velocity", "acceleration"}
    other = Record("other", 1e-3, command + 0.01 * rng.standard_normal(len(command)), position, slow)
    assert other.noise_from_periods == {}


def test_samples_of_an_autoregression_are_worth_as_many_as_bartlett_says() -> None:
    kept = 0.9
    white = np.random.default_rng(1).standard_normal(200000)
    exact = (1.0 + kept**2) / (1.0 - kept**2)  # 1 + 2 Σ kept^(2 k)
    assert samples_for_one(lfilter([1.0], [1.0, -kept], white), 400) == pytest.approx(exact, rel=0.05)
