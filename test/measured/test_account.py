"""What a table makes of the measured runs."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.measured.harmonics import HarmonicAccount, HarmonicProblem, HarmonicRun, account
from shake_ros.settings import find, load_table, read_yaml
from shake_ros.signals.thd import harmonics

VECTOR = load_table("bergamo").vector()


@pytest.fixture(scope="module")
def problem() -> HarmonicProblem:
    content = read_yaml(find("measured", "harmonics"))
    return HarmonicProblem([HarmonicRun(**entry) for entry in content["runs"]])


@pytest.fixture(scope="module")
def result(problem: HarmonicProblem) -> HarmonicAccount:
    return account(problem, VECTOR)


def test_measured_distortion_is_the_one_of_tables_6_1_and_6_2(problem: HarmonicProblem) -> None:
    assert 100 * problem.distortion(problem.measured) == pytest.approx([49.5, 22.6, 17.1, 71.2, 21.2], abs=0.06)


def test_amplitudes_are_those_that_a_fit_sees(problem: HarmonicProblem, result: HarmonicAccount) -> None:
    assert result.amplitudes == pytest.approx(problem.simulated(VECTOR[None, :])[0], rel=1e-12)
    error = result.amplitudes - problem.measured
    assert result.rms == pytest.approx(np.sqrt(np.mean(error**2)))
    assert result.run_rms[4] == pytest.approx(np.sqrt(np.mean(error[-3:] ** 2)))


def test_distortion_agrees_with_a_least_squares_fit_of_the_trace(
    problem: HarmonicProblem, result: HarmonicAccount
) -> None:
    for i in (0, 3):
        time = np.arange(len(result.traces[i])) * problem.sample_time
        found = harmonics(time, result.traces[i], problem.runs[i].frequency, 40).amplitude
        listed = found[problem.runs[i].orders - 1]
        assert result.distortion[i] == pytest.approx(np.sqrt(np.sum(listed[1:] ** 2)) / listed[0], rel=1e-3)


def test_all_orders_hold_at_least_the_measured_ones(result: HarmonicAccount) -> None:
    assert np.all(result.whole_distortion >= result.distortion)
    assert np.all(result.whole_distortion < result.distortion + 0.05)


def test_the_acceleration_repeats_after_half_a_period_with_the_other_sign(result: HarmonicAccount) -> None:
    trace = result.traces[4]  # 10 Hz: a period has 100 samples
    assert trace[:50] == pytest.approx(-trace[50:100], abs=0.02 * np.max(np.abs(trace)))
