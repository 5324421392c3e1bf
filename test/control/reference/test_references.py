"""Each reference against its closed form, and the filter (5.1) against an independent solution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from shake_ros.control.reference import program as reference_filter
from shake_ros.control.reference.motion import smooth_step
from shake_ros.control.reference.program import window
from shake_ros.control.reference.waves import (
    ORDER,
    MultisineParameters,
    PulseParameters,
    RandomBinaryParameters,
    SineBeatParameters,
    SweepParameters,
    binary_period,
)
from shake_ros.quantities import ShakeError

MULTISINE = MultisineParameters(
    period=4.0,
    periods=2,
    start_frequency=0.5,
    end_frequency=10.0,
    grid="odd",
    spectrum="velocity",
    levels="",
    seed=3,
    draws=20,
    peak_position=0.05,
    peak_velocity=0.25,
    peak_acceleration=3.0,
)
SWEEP = SweepParameters(
    spacing="log",
    start_frequency=0.5,
    end_frequency=20.0,
    duration=20.0,
    peak_position=0.05,
    peak_velocity=0.25,
    peak_acceleration=3.0,
)


def lines(signal: np.ndarray, count: int) -> np.ndarray:
    """Amplitudes of the lines of one period of `count` samples."""
    return np.abs(np.fft.rfft(signal[:count])) * 2.0 / count


@pytest.mark.parametrize("damping", [0.3, 0.7, 1.0, 1.8])
def test_filter_gives_the_closed_step_response(damping: float) -> None:
    omega, h = 15.0, 0.002
    wish = np.full(1000, 0.02)
    wish[0] = 0.0
    states = reference_filter.apply(wish, omega, damping, h)
    solution = solve_ivp(
        lambda t, s: (s[1], omega**2 * (0.02 * min(t / h, 1.0) - s[0]) - 2.0 * damping * omega * s[1]),
        (0.0, 999 * h),
        (0.0, 0.0),
        t_eval=np.arange(1000) * h,
        rtol=1e-10,
        atol=1e-13,
        max_step=h,
    )
    assert np.max(np.abs(states[:, 0] - solution.y[0])) < 1e-9
    assert np.max(np.abs(states[:, 1] - solution.y[1])) < 1e-8
    residual = states[:, 2] + 2.0 * damping * omega * states[:, 1] + omega**2 * states[:, 0] - omega**2 * wish
    assert np.max(np.abs(residual)) < 1e-12


def test_filter_does_not_depend_on_the_sample_time() -> None:
    coarse = reference_filter.apply(np.arange(101) * 0.01, 20.0, 0.7, 0.01)
    fine = reference_filter.apply(np.arange(1001) * 0.001, 20.0, 0.7, 0.001)
    assert np.allclose(coarse, fine[::10], atol=1e-12)


def test_filter_is_stable_far_beyond_the_sampling_rate() -> None:
    states = reference_filter.apply(np.ones(1000) * 0.01, 1e4, 0.1, 0.01)
    assert np.allclose(states[-1], (0.01, 0.0, 0.0), atol=1e-5)


def test_filter_has_settled_after_its_settling_time() -> None:
    for damping in (0.2, 0.7, 3.0):
        count = int(reference_filter.settling_time(10.0, damping) / 0.001)
        wish = np.ones(count)
        wish[0] = 0.0
        assert abs(reference_filter.apply(wish, 10.0, damping, 0.001)[-1, 0] - 1.0) < 1e-6


def test_smooth_step_has_continuous_curvature_at_both_ends() -> None:
    for part in smooth_step(np.array([-1.0, 0.0, 1e-9]))[1:]:
        assert np.allclose(part, 0.0, atol=1e-6)
    value, slope, curvature = smooth_step(np.array([1.0 - 1e-9, 1.0, 2.0]))
    assert np.allclose(value, 1.0)
    assert np.allclose(slope, 0.0)
    assert np.allclose(curvature, 0.0, atol=1e-6)


def test_window_is_one_between_start_and_stop() -> None:
    value, slope, curvature = window(np.arange(1001) * 0.01, 2.0, 3.0)
    assert np.all(value[200:701] == 1.0)
    assert value[0] == value[-1] == slope[0] == slope[-1] == curvature[0] == curvature[-1] == 0.0
    assert np.allclose(np.gradient(value, 0.01)[1:-1], slope[1:-1], atol=5e-4)


def test_multisine_is_flat_on_its_lines_and_empty_elsewhere() -> None:
    states, notes = MULTISINE.motion(0.001)
    count = notes["period_samples"]
    assert count == 4000
    found = lines(states[:, 1], count)
    excited = np.arange(3, 41, 2)
    assert notes["lines"] == excited.size
    assert np.allclose(found[excited], found[3], rtol=1e-9)
    others = np.delete(found, excited)
    assert np.max(others) < 1e-9 * found[3]


@pytest.mark.parametrize("spectrum", ["position", "velocity", "acceleration"])
def test_multisine_levels_are_those_of_the_named_signal(spectrum: str) -> None:
    states, notes = MULTISINE.replace(spectrum=spectrum, levels="1:1 10:0.1").motion(0.001)
    found = lines(states[:, ORDER[spectrum]], notes["period_samples"])
    expected = np.interp(np.log(np.arange(5, 41, 2) / 4.0), np.log([1.0, 10.0]), [1.0, 0.1])
    assert np.allclose(found[5:41:2] / found[3], expected, rtol=1e-9)


def test_multisine_repeats_exactly_and_meets_its_limits() -> None:
    states, _ = MULTISINE.motion(0.001)
    assert np.array_equal(states[:4000], states[4000:8000])
    ratios = np.max(np.abs(states), axis=0) / (0.05, 0.25, 3.0)
    assert np.max(ratios) == pytest.approx(1.0)


def test_multisine_leaves_one_odd_line_of_four_empty() -> None:
    states, notes = MULTISINE.replace(grid="odd_random").motion(0.001)
    found = lines(states[:, 1], notes["period_samples"])[3:41:2] > 1e-9
    assert notes["lines"] == np.count_nonzero(found) == 15
    assert all(np.count_nonzero(found[i : i + 4]) == 3 for i in range(0, 16, 4))


def test_multisine_seed_changes_phases_and_draws_lower_the_crest_factor() -> None:
    one, many = (MULTISINE.replace(draws=n).motion(0.001).notes["crest_factor"] for n in (1, 200))
    assert many < one
    other = MULTISINE.replace(seed=4).motion(0.001).states
    assert not np.allclose(other, MULTISINE.motion(0.001).states)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"period": 4.0003}, "not a whole number of samples"),
        ({"start_frequency": 5.01, "end_frequency": 5.02}, "no odd line"),
        ({"end_frequency": 200.0}, "half the sampling rate"),
        ({"levels": "1:2:3"}, "levels '1:2:3'"),
        ({"levels": "2:1 1:1"}, "rising frequencies"),
        ({"levels": "1:nan"}, "rising frequencies"),
        ({"levels": "1:0"}, "every level is zero"),
    ],
)
def test_multisine_that_cannot_be_made_says_why(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ShakeError, match=message):
        MULTISINE.replace(**changes).motion(0.0025 if "end_frequency" in changes else 0.001)


@pytest.mark.parametrize("spacing", ["log", "linear"])
def test_sweep_crosses_zero_at_the_frequencies_it_promises(spacing: str) -> None:
    parameters = SWEEP.replace(spacing=spacing)
    states, _ = parameters.motion(0.0005)
    time = np.arange(len(states)) * 0.0005
    crossing = time[np.flatnonzero(np.diff(np.signbit(states[:, 0])))]
    middle, half = 0.5 * (crossing[1:] + crossing[:-1]), np.diff(crossing)
    share = middle / 20.0
    promised = 0.5 * 40.0**share if spacing == "log" else 0.5 + 19.5 * share
    assert np.allclose((0.5 / half)[5:-5], promised[5:-5], rtol=0.03)


def test_sweep_is_set_by_position_then_velocity_then_acceleration() -> None:
    states, _ = SWEEP.motion(0.001)
    largest = np.max(np.abs(states), axis=0)
    assert np.all(largest < (0.0501, 0.2505, 3.005))
    assert np.all(largest > (0.045, 0.20, 2.95))
    assert np.argmax(np.abs(states[:, 0])) < np.argmax(np.abs(states[:, 1])) < np.argmax(np.abs(states[:, 2]))


def test_sweep_down_is_as_good_as_up() -> None:
    states, _ = SWEEP.replace(start_frequency=20.0, end_frequency=0.5).motion(0.001)
    assert np.all(np.max(np.abs(states), axis=0) < (0.0501, 0.2505, 3.01))


BEATS = SineBeatParameters(frequencies="2 5", amplitude=1.5, cycles=5, beats=2, pause=2.0)


def test_beats_swell_to_their_amplitude_and_end_where_they_began() -> None:
    states, _ = BEATS.motion(0.001)
    assert len(states) == 1 + 2 * 4500 + 2 * 3000  # 5 cycles of 2 Hz and of 5 Hz, each with its pause
    assert np.max(np.abs(states[:, 2])) == pytest.approx(1.5, rel=0.02)
    for end in (4500, 9000, 12000, 15000):
        assert np.abs(states[end]) == pytest.approx(0.0, abs=1e-9)
    spectrum = np.abs(np.fft.rfft(states[9000:10000, 2], 20000))
    assert np.argmax(spectrum) / 20.0 == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(
    ("frequencies", "said"),
    [("2 two", "are not numbers"), ("", "positive numbers"), ("-1", "positive numbers"), ("600", "half the sampling")],
)
def test_beats_that_cannot_be_made_say_why(frequencies: str, said: str) -> None:
    with pytest.raises(ShakeError, match=said):
        BEATS.replace(frequencies=frequencies).motion(0.001)


def test_pulses_alternate_and_return_to_zero() -> None:
    parameters = PulseParameters(
        amplitude=0.02, delay=0.5, rise_time=0.2, hold_time=0.3, rest_time=0.3, repetitions=3, alternating=True
    )
    states, _ = parameters.motion(0.001)
    assert len(states) == 3501
    assert states[[850, 1850, 2850], 0] == pytest.approx([0.02, -0.02, 0.02])
    assert states[[0, 499, 1350, 2350, 3500], 0] == pytest.approx(np.zeros(5))
    assert np.max(np.abs(states[:, 1])) == pytest.approx(0.02 * 1.875 / 0.2, rel=1e-4)


BINARY = RandomBinaryParameters(amplitude=0.01, bits=5, chip=0.2, rise_time=0.1, periods=2)


@pytest.mark.parametrize("bits", [2, 5, 9])
def test_a_binary_period_is_correlated_with_itself_at_no_lag_alone(bits: int) -> None:
    period = binary_period(bits)
    count = 2**bits - 1
    assert len(period) == count
    correlation = np.fft.irfft(np.abs(np.fft.rfft(period)) ** 2, count) / count
    np.testing.assert_allclose(correlation, np.where(np.arange(count) == 0, 1.0, -1.0 / count), atol=1e-9)


def test_a_binary_signal_stands_at_its_two_positions_and_begins_and_ends_in_the_middle_at_rest() -> None:
    states = BINARY.motion(1e-3).states
    stands = states[150 : 150 + 200 * 62 : 200, 0]  # late in every chip
    np.testing.assert_allclose(stands, 0.01 * np.tile(binary_period(5), 2), atol=1e-12)
    np.testing.assert_allclose(states[[0, -1]], 0.0, atol=1e-12)


def test_velocity_and_acceleration_of_a_binary_signal_are_the_derivatives_of_its_position() -> None:
    x, v, a = BINARY.motion(1e-4).states.T
    assert np.max(np.abs(np.gradient(x, 1e-4) - v)) < 2e-3 * np.max(np.abs(v))
    assert np.max(np.abs(np.gradient(v, 1e-4) - a)) < 2e-2 * np.max(np.abs(a))


def test_a_ramp_longer_than_a_chip_is_refused() -> None:
    with pytest.raises(ShakeError, match="longer than a chip"):
        BINARY.replace(rise_time=0.3).motion(1e-3)
