"""Figures of a run against closed forms, on made-up motions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.control.closed_loop import ClosedLoop
from shake_ros.control.metrics import Judged, Metrics, Outcome, by_load, judge, spectrum_of, summarise, tracking_delay

DT, STROKE, OMEGA = 0.001, 0.26, 4.0 * math.pi
TIME = np.arange(4000) * DT


def motion(amplitude: float = 0.02, lag: float = 0.0, distortion: float = 0.0) -> np.ndarray:
    """A sine of 2 Hz for 4 s, its derivatives, and a third harmonic in the acceleration."""
    phase = OMEGA * (TIME - lag)
    third = distortion * amplitude * OMEGA**2 * np.sin(3.0 * phase)
    return np.column_stack(
        (
            amplitude * np.sin(phase),
            amplitude * OMEGA * np.cos(phase),
            -amplitude * OMEGA**2 * np.sin(phase) + third,
        )
    )


def run_of(reference: np.ndarray, truth: np.ndarray, command: np.ndarray | None = None) -> ClosedLoop:
    """A run without estimate and measurement."""
    u = np.zeros(len(truth)) if command is None else command
    return ClosedLoop(DT, reference, truth, truth, u, np.zeros((len(truth), 5)))


def part_of(reference: np.ndarray, rest: int | None = None) -> Judged:
    n = len(reference)
    return Judged(0, n, n if rest is None else rest, 2.0, spectrum_of(reference[:, 2], DT))


def test_perfect_tracking_has_no_error() -> None:
    reference = motion()
    found = judge(run_of(reference, reference), part_of(reference), 1.0, STROKE)
    for name in ("position_error", "velocity_error", "acceleration_error", "position_peak_error", "spectrum_error"):
        assert getattr(found, name) == 0.0
    assert found.delay == pytest.approx(0.0, abs=1e-6)
    assert found.thd < 1e-6
    assert not found.unstable
    assert not found.end_stop


@pytest.mark.parametrize("lag", [0.0004, 0.0073, -0.0025])
def test_lag_is_the_delay_and_twice_its_half_angle_the_error(lag: float) -> None:
    # |e^{-jωτ} − 1| = 2 sin(ωτ/2), for any quantity of a sine
    reference = motion()
    found = judge(run_of(reference, motion(lag=lag)), part_of(reference), 1.0, STROKE)
    assert found.delay == pytest.approx(lag, abs=2e-5)
    assert found.position_error == pytest.approx(2.0 * math.sin(OMEGA * abs(lag) / 2.0), rel=1e-3)
    assert found.velocity_error == pytest.approx(found.position_error, rel=1e-3)
    assert found.position_peak_error == pytest.approx(found.position_error, rel=1e-2)


def test_delay_does_not_mind_size_and_offset() -> None:
    reference, truth = motion()[:, 0], motion(0.013, 0.006)[:, 0] + 0.02
    assert tracking_delay(reference, truth, DT) == pytest.approx(0.006, abs=2e-5)


def test_table_at_rest_has_no_delay() -> None:
    assert math.isnan(tracking_delay(motion()[:, 0], np.zeros(len(TIME)), DT))


def test_third_harmonic_is_the_distortion() -> None:
    reference = motion()
    found = judge(run_of(reference, motion(distortion=0.2)), part_of(reference), 1.0, STROKE)
    assert found.thd == pytest.approx(0.2, rel=1e-6)
    assert found.acceleration_error == pytest.approx(0.2, rel=1e-6)


def test_spectrum_of_a_motion_one_tenth_too_large_is_one_tenth_off() -> None:
    reference = motion()
    found = judge(run_of(reference, 1.1 * reference), part_of(reference), 1.0, STROKE)
    assert found.spectrum_error == pytest.approx(0.1, rel=1e-9)
    assert found.spectrum_largest_error == pytest.approx(0.1, rel=1e-9)


def test_command_counts_at_its_limit_and_on_its_way() -> None:
    reference = motion()
    command = np.zeros(len(TIME))
    command[1000:2000] = 0.8
    found = judge(run_of(reference, reference, command), part_of(reference), 0.8, STROKE)
    assert found.time_at_limit == pytest.approx(0.25)
    assert found.command_travel == pytest.approx(1.6 / 3.999)


def test_loop_that_goes_on_oscillating_is_unstable() -> None:
    reference = motion()
    truth = reference.copy()
    reference[3000:] = 0.0
    part = Judged(0, 3000, 3500, 2.0, spectrum_of(reference[:3000, 2], DT))
    assert judge(run_of(reference, truth), part, 1.0, STROKE).unstable
    truth[3500:, 2] = 0.01
    assert not judge(run_of(reference, truth), part, 1.0, STROKE).unstable


def test_lost_run_and_run_into_the_end_stop_are_reported() -> None:
    reference = motion()
    lost = motion()
    lost[2000:] = np.nan
    found = judge(run_of(reference, lost), part_of(reference), 1.0, STROKE)
    assert found.unstable
    assert math.isnan(found.position_error)
    far = reference + np.array([0.13, 0.0, 0.0])
    assert judge(run_of(reference, far), part_of(reference), 1.0, STROKE).end_stop


def test_summary_takes_mean_worst_and_counts() -> None:
    def outcome(entry: str, load: float, table: int, error: float, unstable: bool = False) -> Outcome:
        return Outcome(entry, "sine", load, table, Metrics(position_error=error, unstable=unstable))

    outcomes = [
        outcome("a", 0.0, -1, 0.01),
        outcome("a", 500.0, -1, 0.03),
        outcome("a", 0.0, 0, 0.05),
        outcome("a", 0.0, 1, math.nan, True),
        outcome("b", 0.0, -1, 0.02),
    ]
    first, second = summarise(outcomes)
    assert (first.entry, second.entry) == ("a", "b")
    assert first.mean.position_error == pytest.approx(0.02)
    assert first.worst.position_error == 0.03
    assert first.perturbed_worst.position_error == 0.05
    assert (first.unstable, first.end_stops) == (1, 0)
    assert math.isnan(first.mean.thd)
    assert by_load(outcomes, "a", "position_error") == {0.0: 0.01, 500.0: 0.03}
