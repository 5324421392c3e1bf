"""Harmonic amplitudes under open-loop sines."""

from __future__ import annotations

import hidden_table
import numpy as np
import pytest

from shake_ros.measured.harmonics import HarmonicProblem, HarmonicRun, amplitudes, sine_command, whole_periods
from shake_ros.quantities import ShakeError
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
    command = sine_command(RUN, 0.001, 1000)
    assert command[0] == 0.3
    assert len(command) == 1000
    assert np.sum(command[500:]) == pytest.approx(0.0, abs=1e-9)


def test_simulated_amplitudes_agree_with_the_independent_model() -> None:
    problem = HarmonicProblem([RUN])
    own = problem.simulated(load_table("bergamo").vector()[None, :])[0]
    acceleration = hidden_table.open_loop(sine_command(RUN, 0.001, 1000), hidden_table.constants())
    other = amplitudes(acceleration[500:], 0.001, 2.0, RUN.orders)
    assert own == pytest.approx(other, rel=0.01, abs=0.005)
    assert problem.residuals(load_table("bergamo").vector()[None, :])[0] == pytest.approx(own - RUN.measured)


@pytest.mark.parametrize(("frequency", "samples"), [(2.0, 500), (5.0, 600), (10.0, 500), (3.0, 1000), (0.4, 2500)])
def test_window_is_the_shortest_stretch_of_whole_periods_and_samples(frequency: float, samples: int) -> None:
    assert whole_periods(frequency, 0.001, 0.5) == samples
    assert samples * 0.001 * frequency == pytest.approx(round(samples * 0.001 * frequency))


def test_frequency_without_whole_samples_is_refused_with_its_value() -> None:
    with pytest.raises(ShakeError, match=r"frequency = 3\.14159 Hz"):
        HarmonicProblem([HarmonicRun(0.3, 3.14159, {1: 1.0})])


def test_order_above_half_the_sampling_rate_is_refused() -> None:
    with pytest.raises(ShakeError, match="order 51 is not below half the sampling rate, 500 Hz"):
        HarmonicProblem([HarmonicRun(0.3, 10.0, {1: 1.0, 51: 0.1})])


@pytest.mark.parametrize(
    ("amplitude", "frequency", "harmonics", "named"),
    [
        (1.2, 2.0, {1: 1.0}, "amplitude = 1.2"),
        (0.3, -2.0, {1: 1.0}, "frequency = -2.0"),
        (0.3, float("nan"), {1: 1.0}, "frequency = nan"),
        (0.3, 2.0, {3: 1.0}, "order 1, is missing"),
        (0.3, 2.0, {1: 1.0, 3: "x"}, "order 3 = 'x'"),
        (0.3, 2.0, {1: 1.0, 2.5: 1.0}, "order 2.5"),
        (0.3, 2.0, [1.0], "order 1, is missing"),
    ],
)
def test_run_that_cannot_be_is_refused_with_its_value(
    amplitude: float, frequency: float, harmonics: dict[int, float], named: str
) -> None:
    with pytest.raises(ShakeError, match=named):
        HarmonicRun(amplitude, frequency, harmonics)


def test_part_of_a_problem_simulates_its_runs_as_the_whole_does() -> None:
    whole = HarmonicProblem([RUN, HarmonicRun(0.2, 10.0, {1: 12.7, 3: 2.66})])
    vector = load_table("bergamo").vector()[None, :]
    part = whole.part([1])
    assert [(span.start, span.stop) for span in whole.spans] == [(0, 3), (3, 5)]
    assert part.measured.tolist() == [12.7, 2.66]
    assert part.simulated(vector)[0] == pytest.approx(whole.simulated(vector)[0, whole.spans[1]], rel=1e-12)
