"""Describing functions against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table
from shake_ros.signals.frequency_response import describing_function

TABLE = load_table("bergamo")
DT = 1e-3


def backlash_of_half_width(ratio: float) -> complex:
    """Describing function of backlash whose half-width is `ratio` times the amplitude (textbook form)."""
    k = 1.0 - 2.0 * ratio
    real = 0.5 + (math.asin(k) + k * math.sqrt(1.0 - k * k)) / math.pi
    return complex(real, -(1.0 - k * k) / math.pi)


def test_spool_without_hysteresis_has_the_linear_response_at_every_amplitude() -> None:
    table = TABLE.with_values({"valve.hysteresis": 0.0})
    frequencies = np.array([5.0, 20.0, 100.0])
    result = describing_function(table, np.array([0.1, 0.5]), frequencies, output="spool")
    s = 2j * np.pi * frequencies
    omega, d = 1600.0, 0.736
    hold = np.exp(-s * DT / 2.0) * np.sinc(frequencies * DT)
    expected = omega**2 / (s**2 + 2.0 * d * omega * s + omega**2) * hold
    # sampling folds the staircase's image at 900 Hz back on 100 Hz, 0.7 %
    np.testing.assert_allclose(result.response, np.vstack([expected, expected]), rtol=1e-2)
    np.testing.assert_allclose(result.gain, np.abs(result.response))


def test_hysteresis_has_the_describing_function_of_backlash() -> None:
    table = TABLE.with_values({"valve.hysteresis": 0.02})
    result = describing_function(table, np.array([0.05, 0.1, 0.4]), np.array([1.0]), output="spool")
    lag = np.exp(-2j * np.pi * (DT / 2.0 + 2.0 * 0.736 / 1600.0))  # hold and spool at 1 Hz
    for i, amplitude in enumerate(result.amplitudes):
        assert result.response[i, 0] / lag == pytest.approx(backlash_of_half_width(0.02 / amplitude), abs=5e-3)


def test_velocity_gain_is_the_valves_flow_over_the_area_at_low_frequency_and_moderate_command() -> None:
    result = describing_function(TABLE, np.array([0.3]), np.array([1.0]))
    flow = 1.81e-7 * math.sqrt(205e5 / 2.0) / 9.4562e-4  # at no load [m/s]
    assert result.gain[0, 0] == pytest.approx(flow, rel=0.06)
    assert abs(result.phase[0, 0]) < 0.05


def test_velocity_gain_rises_in_the_underlap_and_falls_beyond_the_oil_column() -> None:
    result = describing_function(TABLE, np.array([0.01, 0.3]), np.array([2.0, 60.0]))
    assert result.gain[0, 0] > 1.2 * result.gain[1, 0]  # both edges of each port are open there
    assert result.gain[1, 1] < 0.5 * result.gain[1, 0]
    assert abs(result.phase[1, 1]) > 1.5


@pytest.mark.parametrize(("amplitude", "frequency"), [(0.0, 1.0), (1.2, 1.0), (0.5, 600.0)])
def test_what_is_no_amplitude_or_frequency_is_refused(amplitude: float, frequency: float) -> None:
    with pytest.raises(ShakeError):
        describing_function(TABLE, np.array([amplitude]), np.array([frequency]))
    with pytest.raises(ShakeError, match="velocity"):
        describing_function(TABLE, np.array([0.1]), np.array([1.0]), output="speed")
