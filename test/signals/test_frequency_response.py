"""Frequency response after Welch: a first-order lag with a dead time, noise, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from shake_ros.quantities import ShakeError
from shake_ros.signals.frequency_response import frequency_response

DT = 1e-3
LAG, DEAD = 0.02, 25


@pytest.fixture(scope="module")
def signals() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    given = rng.standard_normal(120000)
    left = np.exp(-DT / LAG)
    answer = lfilter([1.0 - left], [1.0, -left], np.concatenate([np.zeros(DEAD), given[:-DEAD]]))
    return given, answer


def test_gain_and_delay_are_those_of_the_lag_and_the_dead_time(signals: tuple[np.ndarray, np.ndarray]) -> None:
    found = frequency_response(*signals, DT, 2.0)
    for f in (1.0, 5.0, 20.0):
        gain, delay, coherence = found.at(f)
        left, z = np.exp(-DT / LAG), np.exp(2j * np.pi * f * DT)
        exact = (1.0 - left) / (1.0 - left / z)
        assert gain == pytest.approx(abs(exact), rel=0.03)
        assert delay == pytest.approx(DEAD * DT - np.angle(exact) / (2.0 * np.pi * f), abs=1.5e-3)
        assert coherence > 0.98


def test_noise_on_the_response_lowers_the_coherence_and_not_the_gain(signals: tuple[np.ndarray, np.ndarray]) -> None:
    given, answer = signals
    noisy = answer + np.std(answer) * np.random.default_rng(4).standard_normal(len(answer))
    clean, rough = (frequency_response(given, y, DT, 1.0) for y in (answer, noisy))
    band = clean.frequency < 10.0
    assert np.mean(rough.coherence[band]) < np.mean(clean.coherence[band])
    assert np.mean(rough.gain[band] / clean.gain[band]) == pytest.approx(1.0, abs=0.02)
    spread = np.std(rough.gain[band] / clean.gain[band])
    assert 0.5 < spread / np.mean(rough.deviation[band]) < 2.0


def test_what_cannot_be_is_refused_with_its_reason(signals: tuple[np.ndarray, np.ndarray]) -> None:
    given, answer = signals
    with pytest.raises(ShakeError, match="window"):
        frequency_response(given, answer, DT, 1e-3)
    with pytest.raises(ShakeError, match="window"):
        frequency_response(given, answer, DT, 100.0)
    with pytest.raises(ShakeError, match="constant"):
        frequency_response(np.ones(5000), answer[:5000], DT, 1.0)
    with pytest.raises(ShakeError, match="outside"):
        frequency_response(given, answer, DT, 1.0).at(900.0)
