"""Velocity from position: amplitude, phase and bandwidth against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.core.analysis.differentiation import velocity_from_position
from shake_ros.core.quantities import ShakeError


def gain_and_phase(frequency: float, sample_time: float) -> tuple[float, float]:
    """Velocity of a sine over its closed form, far from the ends."""
    time = np.arange(int(20.0 / sample_time)) * sample_time
    velocity = velocity_from_position(np.sin(2 * np.pi * frequency * time), sample_time)
    middle = slice(len(time) // 4, 3 * len(time) // 4)
    phasor = np.sum(velocity[middle] * np.exp(-2j * np.pi * frequency * time[middle])) / (len(time[middle]) / 2)
    ratio = phasor / (2 * np.pi * frequency)
    return float(abs(ratio)), float(np.angle(ratio))


@pytest.mark.parametrize("frequency", [0.5, 3.0, 11.0, 15.0])
def test_velocity_in_the_working_band_has_the_closed_forms_amplitude_and_no_phase(frequency):
    gain, phase = gain_and_phase(frequency, 0.001)
    assert gain == pytest.approx(1.0, abs=2e-3)
    assert abs(phase) < 1e-3


def test_both_passes_together_have_minus_three_decibels_at_the_cutoff():
    gain, phase = gain_and_phase(40.0, 0.001)
    assert gain == pytest.approx(1 / np.sqrt(2), abs=2e-3)
    assert abs(phase) < 1e-3


def test_an_octave_above_the_cutoff_order_eight_attenuates_by_forty_decibels():
    # 1/(1 + (√2 − 1)·2⁸) = 0.00934 for the analogue filter; the bilinear transform makes it a little steeper
    gain, _ = gain_and_phase(80.0, 0.001)
    assert 0.006 < gain < 0.0095


def test_velocity_at_200_hz_sampling_stays_within_half_a_per_cent_at_15_hz():
    gain, phase = gain_and_phase(15.0, 0.005)
    assert gain == pytest.approx(1.0, abs=5e-3)
    assert abs(phase) < 1e-3


def test_a_ramp_keeps_its_slope_up_to_both_ends():
    velocity = velocity_from_position(0.3 * np.arange(500) * 0.001 - 0.1, 0.001)
    assert np.allclose(velocity, 0.3, rtol=1e-9)


def test_sampling_too_slow_for_the_cutoff_is_differentiated_without_a_filter():
    time = np.arange(200) * 0.02
    velocity = velocity_from_position(np.sin(2 * np.pi * time), 0.02)
    assert velocity[100] == pytest.approx(2 * np.pi * np.cos(2 * np.pi * time[100]), rel=1e-5)


def test_input_is_untouched():
    position = np.sin(np.arange(100) * 0.01)
    before = position.copy()
    velocity_from_position(position, 0.001)
    assert np.array_equal(position, before)


@pytest.mark.parametrize(
    ("position", "word"), [(np.zeros(8), "at least 9"), (np.full(20, np.nan), "sample 0"), (np.zeros((9, 2)), "row")]
)
def test_positions_that_cannot_be_differentiated_are_refused(position, word):
    with pytest.raises(ShakeError, match=word):
        velocity_from_position(position, 0.001)


def test_an_odd_order_is_refused():
    with pytest.raises(ShakeError, match="order = 7"):
        velocity_from_position(np.zeros(20), 0.001, order=7)
