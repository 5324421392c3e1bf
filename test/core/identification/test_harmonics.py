"""Harmonic amplitudes under open-loop sines."""

from __future__ import annotations

import hidden_table
import numpy as np
import pytest

from shake_ros.core.identification.harmonics import HarmonicProblem, HarmonicRun, amplitudes, sine_command
from shake_ros.settings import load_table

RUN = HarmonicRun(0.3, 2.0, {5: 0.29, 1: 2.35, 3: 0.24})


def test_amplitudes_of_a_known_sum_are_found_whatever_the_phases() -> None:
    time = np.arange(1000) * 0.001
    wave = 3.0 * np.sin(2 * np.pi * 2 * time + 0.4) + 0.5 * np.cos(2 * np.pi * 6 * time + 1.0) + 7.0
    assert amplitudes(wave, 0.001, 2.0, np.array([1, 2, 3])) == pytest.approx([3.0, 0.0, 0.5], abs=1e-12)
    assert amplitudes(np.stack([wave, 2 * wave]), 0.001, 2.0, np.array([1]))[:, 0] == pytest.approx([3.0, 6.0])


def test_measured_amplitudes_come_in_rising_order() -> None:
    assert RUN.orders.tolist() == [1, 3, 5]
    assert RUN.measured.tolist() == [2.35, 0.24, 0.29]


def test_command_starts_at_full_opening_and_holds_whole_periods() -> None:
    command = sine_command(RUN, 0.001, 0.5, 0.5)
    assert command[0] == 0.3
    assert len(command) == 1000
    assert np.sum(command[500:]) == pytest.approx(0.0, abs=1e-9)


def test_simulated_amplitudes_agree_with_the_independent_model() -> None:
    problem = HarmonicProblem([RUN])
    own = problem.simulated(load_table("bergamo").vector()[None, :])[0]
    acceleration = hidden_table.open_loop(sine_command(RUN, 0.001, 0.5, 0.5), hidden_table.constants())
    other = amplitudes(acceleration[500:], 0.001, 2.0, RUN.orders)
    assert own == pytest.approx(other, rel=0.01, abs=0.005)
    assert problem.residuals(load_table("bergamo").vector()[None, :])[0] == pytest.approx(own - RUN.measured)
