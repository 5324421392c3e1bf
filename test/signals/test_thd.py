"""Harmonics and THD against closed forms and the amplitudes that the thesis prints."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.settings import config_folder, read_yaml
from shake_ros.signals.thd import (
    Harmonics,
    fundamental_frequency,
    harmonics,
    nearby_fundamental,
    newest_periods,
    total_harmonic_distortion,
)

RATE = 1000.0
SQUARE = math.sqrt(math.pi**2 / 8.0 - 1.0)  # 48.34 %: Σ 1/k² over all odd k is π²/8
TRIANGLE = math.sqrt(math.pi**4 / 96.0 - 1.0)  # 12.12 %: Σ 1/k⁴ over all odd k is π⁴/96
AMPLITUDES = np.array([1.0, 0.3, 0.2, 0.1, 0.15, 0.05, 0.08])
PHASES = np.array([0.3, 1.0, 2.0, -1.0, 0.5, 0.0, 3.0])
KNOWN = math.sqrt(float(np.sum(AMPLITUDES[1:] ** 2)))
TURN = 2.0 * np.pi


def times(duration: float, rate: float = RATE) -> np.ndarray:
    return np.arange(round(duration * rate)) / rate


def square(time: np.ndarray, frequency: float) -> np.ndarray:
    return np.where(np.mod(time * frequency + 1e-9, 1.0) < 0.5, 1.0, -1.0)


def seven(time: np.ndarray, frequency: float) -> np.ndarray:
    k = np.arange(1, 8)
    return np.sin(TURN * frequency * np.outer(time, k) + PHASES) @ AMPLITUDES


def noisy(time: np.ndarray, frequency: float, seed: int, level: float = 0.01) -> np.ndarray:
    """Seven harmonics with white noise, 40 dB below the fundamental unless said otherwise."""
    noise = np.random.default_rng(seed).standard_normal(len(time))
    return seven(time, frequency) + level * math.sqrt(0.5) * noise


def test_thd_of_the_amplitudes_in_tables_6_1_and_6_2_is_what_the_thesis_says() -> None:
    runs = read_yaml(config_folder() / "measured" / "harmonics.yaml")["runs"]
    percent = [round(100.0 * total_harmonic_distortion(list(run["harmonics"].values())), 1) for run in runs]
    assert percent == [49.5, 22.6, 17.1, 71.2, 21.2]
    assert sum(len(run["harmonics"]) for run in runs) == 28


@pytest.mark.parametrize("frequency", [1.0, 2.0, 5.0, 10.0])
@pytest.mark.parametrize("told", [True, False])
def test_a_square_wave_has_48_percent_against_all_harmonics(frequency: float, told: bool) -> None:
    time = times(10.0)
    found = harmonics(time, square(time, frequency), frequency if told else None)
    assert found.frequency == pytest.approx(frequency, rel=1e-6)
    assert found.thd == pytest.approx(SQUARE, rel=1e-3)
    assert found.thd_and_noise == pytest.approx(SQUARE, rel=1e-3)


@pytest.mark.parametrize("frequency", [1.2345, 2.137, 3.7, 9.93])
def test_a_square_wave_out_of_step_with_the_sampling_has_48_percent_too(frequency: float) -> None:
    time = times(20.0)
    found = harmonics(time, square(time, frequency))
    assert found.thd_and_noise == pytest.approx(SQUARE, rel=1e-3)
    order = 5  # its amplitude is 4/(5π)
    assert found.amplitude[order - 1] == pytest.approx(4.0 / (math.pi * order), rel=3e-3)


def test_a_square_wave_has_the_thd_of_the_orders_that_were_asked_for() -> None:
    time = times(10.0)
    found = harmonics(time, square(time, 2.0), 2.0, orders=9)
    assert len(found.amplitude) == 9
    assert found.thd == pytest.approx(math.sqrt(1 / 9 + 1 / 25 + 1 / 49 + 1 / 81), rel=1e-3)
    assert found.thd_and_noise == pytest.approx(SQUARE, rel=1e-3)


def test_a_triangle_wave_has_12_percent() -> None:
    time = times(7.0)
    wave = 2.0 / np.pi * np.arcsin(np.sin(TURN * 2.3456 * time))
    assert harmonics(time, wave).thd == pytest.approx(TRIANGLE, rel=1e-3)


@pytest.mark.parametrize("frequency", [1.987, 5.4321, 13.77])
def test_seven_harmonics_at_an_unknown_frequency_are_found_to_rounding(frequency: float) -> None:
    time = times(5.0)
    found = harmonics(time, 0.7 + seven(time, frequency))
    assert found.frequency == pytest.approx(frequency, rel=1e-12)
    np.testing.assert_allclose(found.amplitude[:7], AMPLITUDES, atol=1e-10)
    np.testing.assert_allclose(found.phase[:7], PHASES, atol=1e-9)
    assert found.offset == pytest.approx(0.7, abs=1e-10)
    assert found.thd == pytest.approx(KNOWN, rel=1e-10)
    assert found.noise < 1e-12
    assert found.floor < 1e-12


@pytest.mark.parametrize("frequency", [1.987, 5.4321, 13.77])
@pytest.mark.parametrize("seed", range(4))
def test_seven_harmonics_in_noise_of_minus_40_db_are_exact_to_a_tenth_of_a_percent(frequency: float, seed: int) -> None:
    time = times(20.0)
    found = harmonics(time, noisy(time, frequency, seed))
    assert found.thd == pytest.approx(KNOWN, rel=1e-3)
    np.testing.assert_allclose(found.amplitude[:7], AMPLITUDES, atol=1e-3 * AMPLITUDES[0])


def test_the_noise_floor_is_the_noise_that_was_added_and_lines_do_not_raise_it() -> None:
    time = times(20.0)
    signal = noisy(time, 5.4321, 3) + 0.05 * np.sin(TURN * 7.77 * time)
    found = harmonics(time, signal)
    assert found.floor == pytest.approx(0.01 * math.sqrt(0.5), rel=0.05)
    assert found.noise == pytest.approx(math.sqrt(0.5 * (0.01**2 + 0.05**2)), rel=0.02)
    assert found.rest == pytest.approx(math.sqrt(0.5 * (0.01**2 + 0.05**2)), rel=0.02)


@pytest.mark.parametrize("level", [0.0, 0.01, 0.3])
def test_distortion_and_noise_add_up_to_all_that_is_not_the_fundamental(level: float) -> None:
    time = times(7.0)
    found = harmonics(time, noisy(time, 3.21, 1, level) + 0.2 * np.sin(TURN * 7.77 * time))
    together = math.hypot(found.thd, math.sqrt(2.0) * found.noise / found.amplitude[0])
    assert together == pytest.approx(found.thd_and_noise, rel=1e-12)
    assert found.noise == pytest.approx(math.sqrt(0.5 * (level**2 + 0.2**2)), rel=0.03)


@pytest.mark.parametrize("off", [-8e-3, -6e-4, 0.0, 1e-6, 3e-3])
@pytest.mark.parametrize("duration", [2.0, 60.0])
def test_fundamental_is_found_near_that_of_another_clock(off: float, duration: float) -> None:
    time = times(duration)
    signal = noisy(time, 5.0 * (1.0 + off), 2)
    assert nearby_fundamental(time, signal, 5.0) == pytest.approx(5.0 * (1.0 + off), abs=2e-3 / duration)


def test_weak_fundamental_is_found_by_its_harmonics_and_another_line_nearby_is_none() -> None:
    time = times(30.0)
    weak = 0.02 * np.sin(TURN * 2.002 * time) + np.sin(TURN * 6.006 * time)
    assert nearby_fundamental(time, weak, 2.0) == pytest.approx(2.002, abs=1e-6)
    apart = np.sin(TURN * 2.0 * time) + 5.0 * np.sin(TURN * 2.3 * time)
    assert nearby_fundamental(time, apart, 2.0) == pytest.approx(2.0, abs=1e-3)


def test_noise_does_not_add_up_to_distortion_over_many_orders() -> None:
    time = times(1.0)
    found = [harmonics(time, noisy(time, 2.0, seed, level=0.1), 2.0) for seed in range(40)]
    assert len(found[0].amplitude) == 249
    as_fitted = np.mean([math.hypot(*h.amplitude[1:]) / h.amplitude[0] for h in found])
    assert as_fitted > KNOWN + 0.005  # half the noise is among so many orders
    assert np.mean([h.thd for h in found]) == pytest.approx(KNOWN, abs=0.0015)


def test_jittering_sample_times_do_not_matter() -> None:
    time = times(5.0) + np.random.default_rng(1).uniform(-3e-4, 3e-4, 5000)
    found = harmonics(time, seven(time, 3.21), orders=9)
    np.testing.assert_allclose(found.amplitude[:7], AMPLITUDES, atol=1e-9)


def test_only_whole_periods_are_used_and_the_newest() -> None:
    time = times(1.0)
    found = harmonics(time, np.sin(TURN * 3.4 * time), 3.4)
    assert found.periods == pytest.approx(3.0, abs=2e-3)
    assert found.stop == time[-1]
    assert time[newest_periods(time, 3.4, 1)][0] == pytest.approx(1.0 - 1.0 / 3.4, abs=1e-3)


def test_phases_are_those_at_time_zero_of_the_given_times() -> None:
    time = times(2.0) + 100.0
    found = harmonics(time, np.sin(TURN * 2.0 * (time - 100.0) + 0.4), 2.0)
    assert found.phase[0] == pytest.approx(0.4, abs=1e-9)  # 100 s are whole periods


def test_a_strong_overtone_does_not_hide_a_fundamental_that_is_given() -> None:
    time = times(5.0)
    found = harmonics(time, 0.2 * np.sin(TURN * 2.0 * time) + np.sin(TURN * 6.0 * time), 2.0)
    assert found.thd == pytest.approx(5.0, rel=1e-9)


def test_a_frequency_nearby_is_refined_to_the_exact_one() -> None:
    time = times(5.0)
    assert fundamental_frequency(time, seven(time, 2.5), near=2.53) == pytest.approx(2.5, rel=1e-10)


def test_inputs_are_left_untouched() -> None:
    time = times(1.0)
    signal = seven(time, 5.0)
    kept = signal.copy()
    harmonics(time, signal)
    np.testing.assert_array_equal(signal, kept)


@pytest.mark.parametrize(
    ("signal", "frequency", "reason"),
    [
        (np.zeros(100), 20.0, "constant"),
        (np.full(100, np.nan), 20.0, "finite"),
        (np.sin(times(0.1) * 30.0), 5.0, "0 whole periods"),
        (np.sin(times(0.1) * 30.0), 700.0, "half the sampling rate"),
        (np.sin(times(0.1) * 30.0), -1.0, "not positive"),
        (np.sin(times(0.1) * 60.0), None, "less than two periods"),
        (np.zeros(3), 20.0, "at least 8"),
    ],
)
def test_what_has_no_harmonics_is_refused_with_the_reason(
    signal: np.ndarray, frequency: float | None, reason: str
) -> None:
    with pytest.raises(ShakeError, match=reason):
        harmonics(np.arange(len(signal)) / RATE, signal, frequency)


def test_amplitudes_without_a_fundamental_have_no_thd() -> None:
    with pytest.raises(ShakeError, match="first of them positive"):
        total_harmonic_distortion([0.0, 1.0])


def test_a_pure_sine_has_no_distortion() -> None:
    time = times(3.0)
    found: Harmonics = harmonics(time, 2.0 * np.sin(TURN * 4.321 * time))
    assert found.thd < 1e-10
    assert found.thd_and_noise < 1e-10
    assert found.amplitude[0] == pytest.approx(2.0, rel=1e-12)
