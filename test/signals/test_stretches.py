"""Only the part of a signal counts in which the excitation is steady; a clipped sensor is noticed."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.signals.stretches import clipped, restored, steady_part

TIME = np.arange(10000) * 0.001
WAVE = np.sin(2.0 * np.pi * 3.3 * TIME)


def test_soft_start_and_stop_are_left_out() -> None:
    envelope = np.interp(TIME, [0.0, 2.0, 7.0, 9.0, 10.0], [0.0, 1.0, 1.0, 0.0, 0.0])
    part = steady_part(TIME, envelope * WAVE, 3.3)
    assert 2.0 <= TIME[part.start] <= 2.7
    assert 6.6 <= TIME[part.stop] <= 7.0


def test_a_wave_without_ramps_is_taken_whole_but_for_its_first_period() -> None:
    part = steady_part(TIME, WAVE, 3.3)
    assert part.start == 303
    assert part.stop == 10000


def test_the_longer_of_two_levels_is_taken() -> None:
    part = steady_part(TIME, np.where(TIME < 4.0, 1.0, 2.0) * WAVE, 3.3)
    assert TIME[part.start] >= 4.0


def test_few_samples_a_period_do_not_break_the_row() -> None:
    part = steady_part(TIME, np.sin(2.0 * np.pi * 97.0 * TIME), 97.0)
    assert part.start < 100
    assert part.stop > 9900


def test_less_than_a_period_is_refused() -> None:
    with pytest.raises(ShakeError, match="no whole period"):
        steady_part(TIME[:100], WAVE[:100], 3.3)


SINE = np.sin(np.arange(2000) / 20.0)


def test_clipped_samples_are_those_at_the_ends() -> None:
    at = clipped(np.clip(SINE, -0.6, 0.7))
    assert np.array_equal(at, (SINE <= -0.6) | (SINE >= 0.7))


def test_peaks_and_constants_are_not_clipped() -> None:
    assert not clipped(SINE).any() and not clipped(np.zeros(50)).any()


def test_restored_samples_follow_the_other_sensor_and_no_others_change() -> None:
    cut = np.clip(0.3 + SINE, -0.3, 0.9)
    at = clipped(cut)
    whole = restored(cut, at, 5.0 * SINE - 2.0)
    assert np.allclose(whole, 0.3 + SINE) and np.array_equal(whole[~at], cut[~at])


def test_a_restored_sample_is_never_nearer_to_the_middle_than_the_clip() -> None:
    cut = np.clip(SINE, -0.6, 0.6)
    at = clipped(cut)
    whole = restored(cut, at, np.where(at, 0.0, SINE))
    assert np.array_equal(whole, cut)
