"""Acceleration spectra against a closed form, against scipy's matrix exponential, and near half the sampling rate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

from shake_ros.core.analysis.oscillators import acceleration_spectrum, peaks
from shake_ros.core.quantities import ShakeError
from shake_ros.core.reference.motion import smooth_step

STEP = 0.001


def record(highest: float, seed: int = 1) -> np.ndarray:
    """Noise up to a frequency [Hz], at rest at both ends."""
    n = 8000
    f = np.fft.rfftfreq(n, STEP)
    phases = np.random.RandomState(seed).uniform(0.0, 2.0 * np.pi, f.size)
    t = np.arange(n) * STEP
    noise = np.fft.irfft(np.where(f < highest, np.exp(1j * phases), 0.0), n) * np.sin(np.pi * t / t[-1]) ** 2
    return np.asarray(noise / np.max(np.abs(noise)))


@pytest.mark.parametrize("damping", [0.005, 0.02, 0.05, 0.20])
def test_a_sine_is_amplified_as_the_closed_form_says(damping: float) -> None:
    n, f0 = 120_000, 8.0
    t = np.arange(n) * STEP
    sine = np.sin(2.0 * np.pi * f0 * t) * smooth_step(t / 40.0)[0] * smooth_step((t[-1] - t) / 40.0)[0]
    f = np.array([4.0, 8.0, 20.0, 200.0])
    r = f0 / f
    exact = np.sqrt((1.0 + (2.0 * damping * r) ** 2) / ((1.0 - r**2) ** 2 + (2.0 * damping * r) ** 2))
    found = acceleration_spectrum(sine, STEP, f, damping)
    np.testing.assert_allclose(found[1:], exact[1:], rtol=1e-3)


@pytest.mark.parametrize("damping", [0.02, 0.10])
def test_spectrum_is_that_of_a_finely_sampled_record_by_a_matrix_exponential(damping: float) -> None:
    a, fine = record(60.0), 16
    n = a.size
    spectrum = np.fft.rfft(a)
    dense = np.fft.irfft(np.pad(spectrum, (0, n * fine // 2 + 1 - spectrum.size)), n * fine) * fine
    t = np.arange(dense.size) * STEP / fine
    frequencies = np.array([1.0, 7.0, 40.0, 100.0])
    found = acceleration_spectrum(a, STEP, frequencies, damping)
    for f, value in zip(frequencies, found, strict=True):
        w = 2.0 * np.pi * f
        system = StateSpace(
            [[0.0, 1.0], [-w * w, -2.0 * damping * w]], [[0.0], [-1.0]], [[-w * w, -2.0 * damping * w]], [[0.0]]
        )
        assert value == pytest.approx(float(np.max(np.abs(lsim(system, dense, t)[1]))), rel=1e-3)


def test_a_response_that_still_grows_where_the_record_ends_counts() -> None:
    n, f0, damping = 3000, 0.2, 0.005
    t = np.arange(n) * STEP
    push = np.sin(np.pi * np.minimum(t, 0.5) / 0.5) ** 2
    w = 2.0 * np.pi * f0
    system = StateSpace(
        [[0.0, 1.0], [-w * w, -2.0 * damping * w]], [[0.0], [-1.0]], [[-w * w, -2.0 * damping * w]], [[0.0]]
    )
    for end in (1500, 3000):  # a quarter of its period of 5 s is later than 1.5 s
        found, _ = peaks(push[:end], STEP, np.array([f0]), damping)
        assert abs(found[0]) == pytest.approx(float(np.max(np.abs(lsim(system, push[:end], t[:end])[1]))), rel=1e-3)


def test_at_four_tenths_of_the_sampling_rate_it_stays_within_two_percent() -> None:
    n, f0 = 8000, 400.0
    t = np.arange(n) * STEP
    window = np.sin(np.pi * t / t[-1]) ** 2
    found, times = peaks(np.sin(2.0 * np.pi * f0 * t + 0.3) * window, STEP, np.array([f0]), 0.05)
    assert abs(found[0]) == pytest.approx(np.sqrt(1.0 + 4.0 * 0.05**2) / (2.0 * 0.05), rel=0.02)
    assert times[0] == pytest.approx(4.0, abs=0.1)


def test_what_is_no_record_or_no_oscillator_is_refused() -> None:
    a, f = record(60.0), np.array([5.0])
    with pytest.raises(ShakeError, match="damping = 0 is not between"):
        acceleration_spectrum(a, STEP, f, 0.0)
    with pytest.raises(ShakeError, match=r"asked for 500 Hz"):
        acceleration_spectrum(a, STEP, np.array([500.0]), 0.05)
    with pytest.raises(ShakeError, match="1 that are not finite"):
        acceleration_spectrum(np.where(np.arange(a.size) == 7, np.nan, a), STEP, f, 0.05)
