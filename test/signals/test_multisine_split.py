"""The split of a response, on static nonlinearities whose lines are known in closed form, and on noise."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.signals.multisine_split import multisine_split, noise_from_periods, repeated_period, whole_periods

N = 1000
DT = 1e-3
TURN = 2.0 * np.pi * np.arange(N) / N
TWO_TONES = np.cos(3.0 * TURN) + np.cos(5.0 * TURN)


def repeated(wave, periods=3):
    return np.tile(wave, periods)


def amplitudes(split):
    return {round(f * N * DT): abs(a) for f, a in zip(split.frequency, split.response, strict=True) if abs(a) > 1e-9}


def odd_random(seed):
    rng = np.random.default_rng(seed)
    lines = np.array([k for k in range(1, 60, 2) if k % 8 != 5])
    return np.sum(np.cos(np.outer(lines, TURN) + rng.uniform(0, 2 * np.pi, len(lines))[:, None]), axis=0) / 5.0


def test_square_of_two_tones_stands_on_its_even_lines():
    split = multisine_split(repeated(TWO_TONES), repeated(TWO_TONES**2), N, DT)
    assert amplitudes(split) == pytest.approx({6: 0.5, 10: 0.5, 2: 1.0, 8: 1.0})
    parts = split.parts()
    assert parts["even"] == pytest.approx(np.sqrt((0.25 + 0.25 + 1.0 + 1.0) / 2.0))
    assert parts["linear"] == pytest.approx(0.0, abs=1e-9)
    assert parts["noise"] == pytest.approx(0.0, abs=1e-9)


def test_cube_of_two_tones_stands_on_its_odd_lines():
    split = multisine_split(repeated(TWO_TONES), repeated(TWO_TONES**3), N, DT)
    known = {9: 0.25, 15: 0.25, 1: 0.75, 7: 0.75, 11: 0.75, 13: 0.75, 3: 2.25, 5: 2.25}
    assert amplitudes(split) == pytest.approx(known)
    assert split.parts()["even"] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(split.gain[split.excited]) == pytest.approx([2.25, 2.25])


def test_linear_response_has_no_distortion():
    u = odd_random(1)
    split = multisine_split(repeated(u), repeated(0.7 * np.roll(u, 4)), N, DT)
    parts = split.parts()
    assert parts["linear"] == pytest.approx(0.7 * np.std(u), rel=1e-9)
    assert parts["even"] < 1e-12 and parts["odd"] < 1e-12
    assert np.abs(split.gain[split.excited]) == pytest.approx(0.7)


def test_parts_of_a_polynomial_add_up_to_its_power():
    u = odd_random(2)
    y = u + 0.3 * u**2 - 0.1 * u**3
    split = multisine_split(repeated(u), repeated(y), N, DT)
    parts = split.parts()
    assert parts["even"] == pytest.approx(0.3 * np.std(u**2), rel=1e-6)
    assert sum(p**2 for p in parts.values()) == pytest.approx(np.var(y), rel=1e-6)
    assert 0.02 < parts["odd"] < 0.1 * np.std(u**3)


def test_odd_distortion_on_excited_lines_is_found_by_lines_left_out():
    u = odd_random(3)
    cubic = 0.05 * u**3
    own = np.fft.rfft(u) @ np.conj(np.fft.rfft(cubic)) / np.sum(np.abs(np.fft.rfft(u)) ** 2)
    stochastic = np.std(cubic - own.real * u)
    split = multisine_split(repeated(u), repeated(u + cubic), N, DT)
    assert split.parts()["odd"] == pytest.approx(stochastic, rel=0.25)


def test_noise_is_what_does_not_repeat():
    rng = np.random.default_rng(4)
    u = odd_random(4)
    y = repeated(u, 9) + 0.2 * rng.standard_normal(9 * N)
    assert multisine_split(repeated(u, 9), y, N, DT).parts()["noise"] == pytest.approx(0.2, rel=0.05)
    assert noise_from_periods(y, N) == pytest.approx(0.2, rel=0.05)


def test_drift_of_a_period_is_not_noise():
    rng = np.random.default_rng(5)
    y = repeated(odd_random(5), 4) + 0.01 * rng.standard_normal(4 * N) + 1e-3 * np.arange(4 * N)
    assert noise_from_periods(y, N) == pytest.approx(0.01, rel=0.06)


def test_distortion_that_a_loop_feeds_back_is_taken_off():
    u = odd_random(6)
    fed_back = u + 0.05 * np.cos(4.0 * TURN) + 0.003 * np.cos(5.0 * TURN)
    split = multisine_split(repeated(fed_back), repeated(2.0 * fed_back), N, DT)
    assert split.parts()["odd"] < 1e-9


def test_excitation_on_even_lines_too_is_said():
    u = TWO_TONES + np.cos(4.0 * TURN)
    assert not multisine_split(repeated(u), repeated(u), N, DT).separates_even_from_odd
    assert multisine_split(repeated(TWO_TONES), repeated(TWO_TONES), N, DT).separates_even_from_odd


def test_without_an_odd_line_left_out_the_odd_part_is_not_known():
    u = np.sum([np.cos(k * TURN + k * k) for k in range(1, 500)], axis=0)
    assert np.isnan(multisine_split(repeated(u), repeated(u), N, DT).parts()["odd"])


def test_the_period_is_found_under_noise():
    rng = np.random.default_rng(7)
    u = repeated(odd_random(7), 3)
    assert repeated_period(u + 0.002 * rng.standard_normal(3 * N)) == N


def test_a_record_that_does_not_repeat_has_no_period():
    time = np.arange(4000) * DT
    assert repeated_period(np.sin(2.0 * np.pi * (1.0 + time) * time)) is None
    assert repeated_period(np.zeros(4000)) is None


def test_the_first_period_is_left_out_where_two_remain():
    assert whole_periods(np.arange(3 * N), N).shape == (2, N)
    assert whole_periods(np.arange(2 * N), N).shape == (2, N)
    assert whole_periods(np.arange(3 * N + 7), N)[0, 0] == N + 7


@pytest.mark.parametrize(("signal", "samples"), [(np.zeros(10), 100), (np.full(300, np.nan), 100), (np.zeros(9), 3)])
def test_a_record_without_a_whole_clean_period_is_refused(signal, samples):
    with pytest.raises(ShakeError):
        whole_periods(signal, samples)


def test_an_excitation_that_does_not_repeat_is_refused():
    rng = np.random.default_rng(8)
    u = rng.standard_normal(3 * N)
    with pytest.raises(ShakeError, match="does not repeat"):
        multisine_split(u, u, N, DT)
    with pytest.raises(ShakeError, match="constant"):
        multisine_split(np.zeros(3 * N), u, N, DT)
