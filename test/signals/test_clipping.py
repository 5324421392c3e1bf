"""A clipped signal: which samples are, and what stands for them."""

from __future__ import annotations

import numpy as np

from shake_ros.signals.stretches import clipped, restored

WAVE = np.sin(np.arange(2000) / 20.0)


def test_clipped_samples_are_those_at_the_ends() -> None:
    at = clipped(np.clip(WAVE, -0.6, 0.7))
    assert np.array_equal(at, (WAVE <= -0.6) | (WAVE >= 0.7))


def test_peaks_and_constants_are_not_clipped() -> None:
    assert not clipped(WAVE).any() and not clipped(np.zeros(50)).any()


def test_restored_samples_follow_the_other_sensor_and_no_others_change() -> None:
    cut = np.clip(0.3 + WAVE, -0.3, 0.9)
    at = clipped(cut)
    whole = restored(cut, at, 5.0 * WAVE - 2.0)
    assert np.allclose(whole, 0.3 + WAVE) and np.array_equal(whole[~at], cut[~at])


def test_a_restored_sample_is_never_nearer_to_the_middle_than_the_clip() -> None:
    cut = np.clip(WAVE, -0.6, 0.6)
    at = clipped(cut)
    whole = restored(cut, at, np.where(at, 0.0, WAVE))
    assert np.array_equal(whole, cut)
