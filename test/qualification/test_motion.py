"""Motions matched to a required spectrum: their level, their peak, and what corrections leave of the lower end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shake_ros.qualification import motion as motions
from shake_ros.qualification.motion import MotionParameters, corrected_drive, frequencies_to_match, synthesise
from shake_ros.qualification.required import RequiredSpectrum
from shake_ros.settings import load_table
from shake_ros.signals.response_spectrum import response_spectrum

STEP, AIM = 0.004, 1.1
SHORT = MotionParameters(
    rise=1.0, strong=6.0, decay=1.0, aim=AIM, aim_last=AIM, seeds=1, high_pass=0.6, per_octave=12,
    position_share=0.9, velocity_share=0.85, force_share=0.85,
)  # fmt: skip


def spectrum(zero_period: float) -> RequiredSpectrum:
    f, levels = np.array([1.0, 3.0, 8.0, 15.0]), np.array([1.0, 4.0, 4.0, 2.0])
    return RequiredSpectrum("short", f, levels, 0.05, zero_period, "of this test")


def test_motion_has_the_spectrum_that_is_aimed_at() -> None:
    required = spectrum(1.0)
    motion = synthesise(required, load_table("bergamo"), SHORT, STEP, seed=1)
    f, levels = frequencies_to_match(required, 12)
    inside = f <= 15.0
    # Nigam and Jennings, apart from the filter that matched it; 62 points a second and more at 15 Hz miss peaks by 4 %
    found = np.abs(response_spectrum(motion, STEP, f[inside], 0.05).acceleration)
    np.testing.assert_allclose(found / (AIM * levels[inside]), 1.0, atol=0.12)


def test_motion_is_raised_to_the_zero_period_where_its_spectrum_alone_leaves_it_below() -> None:
    table = load_table("bergamo")
    free = np.max(np.abs(synthesise(spectrum(0.1), table, SHORT, STEP, seed=1)))
    asked = 1.15 * free / AIM
    raised = np.max(np.abs(synthesise(spectrum(asked), table, SHORT, STEP, seed=1)))
    assert raised > 0.97 * AIM * asked > free


def test_peaks_above_the_rigid_end_are_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    required = replace(spectrum(1.2), levels=np.array([1.0, 4.0, 4.0, 1.2]))
    limit = 1.1 * AIM * 1.2  # the last level is what a rigid body feels
    assert np.max(np.abs(synthesise(required, load_table("bergamo"), SHORT, STEP, seed=2))) < limit
    monkeypatch.setattr(motions, "TOP", 100.0)
    assert np.max(np.abs(synthesise(required, load_table("bergamo"), SHORT, STEP, seed=2))) > limit


def test_corrections_do_not_wear_off_the_first_frequency() -> None:
    required = spectrum(0.1)
    motion = synthesise(required, load_table("bergamo"), SHORT, STEP, seed=1)
    levels = frequencies_to_match(required, 12)[1]
    met, peak = AIM * levels, AIM * required.zero_period
    for _ in range(3):  # each asks for the spectrum that the drive has already
        motion = corrected_drive(motion, met, peak, required, SHORT, STEP, gain=0.8)
    first = abs(response_spectrum(motion, STEP, np.array([1.0]), 0.05).acceleration[0])
    assert abs(first / (AIM * levels[0]) - 1.0) < 0.05
