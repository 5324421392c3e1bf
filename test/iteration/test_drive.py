"""Drive-file iteration and harmonic cancellation on tables whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from shake_ros.control.laws import harmonic_cancellation
from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.iteration import drive as iteration
from shake_ros.packing import numbers
from shake_ros.quantities import ShakeError
from shake_ros.settings import find, read_yaml

DT = 0.001
N = 8000


def settings(**changes: float) -> iteration.Iteration:
    path = find("iteration", "default")
    return iteration.Iteration.from_mapping(read_yaml(path), str(path)).replace(**changes)


def burst() -> NDArray[np.float64]:
    """An acceleration of 1 … 12 Hz that begins and ends at rest, (n,) [m/s²]."""
    rng = np.random.default_rng(4)
    frequency = np.fft.rfftfreq(N, DT)
    spectrum = iteration.band(frequency, 1.0, 12.0) * np.exp(2j * math.pi * rng.random(frequency.size))
    signal = np.fft.irfft(spectrum, N) * np.hanning(N)
    return iteration.faded_to_rest(signal / np.std(signal), DT)


def linear_table(drive: NDArray[np.float64]) -> NDArray[np.float64]:
    """Achieved acceleration: second order at 9 Hz, damping 0.3, and 4 ms late."""
    f = np.fft.rfftfreq(N, DT)
    answer = 1.0 / (1.0 - (f / 9.0) ** 2 + 0.6j * f / 9.0) * np.exp(-2j * math.pi * f * 0.004)
    return np.fft.irfft(answer * np.fft.rfft(drive), N)


def test_iteration_inverts_a_linear_table_and_stops() -> None:
    wanted = burst()
    first = states_from_rest(wanted, DT)
    p = settings(good_enough=0.03)
    references, errors, reason = iteration.iterate(wanted, first, lambda r, _: linear_table(r[:, 2]), DT, p)
    assert errors[0] > 0.5
    assert errors[-1] <= 0.03
    assert reason == "good enough"
    assert len(errors) <= 8
    np.testing.assert_allclose(references[-1][-1, :2], 0.0, atol=1e-9)  # ends at rest in the middle


def test_iteration_stops_where_the_error_does_not_fall() -> None:
    wanted = burst()
    rng = np.random.default_rng(1)
    noise = [rng.normal(size=N) for _ in range(20)]
    first = states_from_rest(wanted, DT)
    _, errors, reason = iteration.iterate(wanted, first, lambda _r, k: noise[k], DT, settings(runs=20))
    assert reason == "no longer falls"
    assert len(errors) < 8


def test_drive_is_scaled_into_its_limits_as_a_whole() -> None:
    wanted = burst()
    runs = [iteration.Run(wanted, linear_table(wanted))]
    free, one = iteration.next_drive(wanted, runs, DT, settings())
    held, factor = iteration.next_drive(wanted, runs, DT, settings(velocity_limit=0.05))
    assert one == 1.0
    assert factor < 1.0
    np.testing.assert_allclose(held, factor * free)
    assert np.max(np.abs(held[:, 1])) == pytest.approx(0.05)


def test_response_of_a_linear_table_is_found_with_coherence_one() -> None:
    wanted = burst()
    found, coherence = iteration.response([iteration.Run(wanted, 0.5 * wanted)], DT, 0.6, 0.0)
    inside = slice(16, 80)  # 2 … 10 Hz
    np.testing.assert_allclose(found[inside], 0.5, rtol=1e-9)
    np.testing.assert_allclose(coherence[inside], 1.0, rtol=1e-9)


def test_noise_of_the_accelerometer_does_not_move_the_next_drive_aside() -> None:
    wanted = np.pad(burst(), 2000)  # a ramp from end to end of the noise's 0.05 m/s² would reach decimetres
    noise = 0.05 * np.random.RandomState(5).standard_normal(len(wanted))
    drive, _ = iteration.next_drive(wanted, [iteration.Run(wanted, wanted + noise)], DT, settings())
    assert np.max(np.abs(drive[:, 0] - states_from_rest(wanted, DT)[:, 0])) < 0.002


def test_noise_where_the_drive_has_no_power_does_not_stop_the_learning() -> None:
    # above 8 Hz the drive is silent and the accelerometer is not: S_AD/S_DD has any size there
    frequency = np.fft.rfftfreq(len(burst()), DT)
    wanted = np.fft.irfft(np.fft.rfft(burst()) * (frequency < 8.0), len(burst()))
    achieved = 0.7 * wanted + 0.01 * np.std(wanted) * np.random.RandomState(2).standard_normal(len(wanted))
    drive, _ = iteration.next_drive(wanted, [iteration.Run(wanted, achieved)], DT, settings(learning_gain=1.0))
    before, after = (iteration.error_in_band(wanted, 0.7 * d, DT, settings()) for d in (wanted, drive[:, 2]))
    assert before > 0.2
    assert after < 0.05


def test_next_drive_is_built_on_the_best_run_with_half_the_gain_after_a_worse_one() -> None:
    wanted = burst()
    good, bad = iteration.Run(wanted, 0.9 * wanted), iteration.Run(2.0 * wanted, 1.8 * wanted)
    one, _ = iteration.drive_from_best(wanted, [good], [0.1], DT, settings())
    again, _ = iteration.drive_from_best(wanted, [good, bad], [0.1, 0.8], DT, settings())
    np.testing.assert_allclose(again[:, 2] - wanted, 0.5 * (one[:, 2] - wanted), atol=0.02 * np.std(one[:, 2] - wanted))


def test_runs_of_different_lengths_are_refused() -> None:
    with pytest.raises(ShakeError, match="one length"):
        iteration.response([iteration.Run(np.zeros(5), np.zeros(6))], DT, 0.6, 0.0)


def test_harmonics_of_a_lagging_loop_are_cancelled() -> None:
    # acceleration 5 ms late and of half size, with a cubic distortion of it and noise of the accelerometer
    p = harmonic_cancellation.HarmonicCancellation(
        fundamental_frequency=2.0, harmonics=9, learning_gain=0.6, settling_periods=1, window_periods=2,
        amplitude_limit=5.0,
    )  # fmt: skip
    packed, state, omega = numbers(p), harmonic_cancellation.initial_state(p), 4.0 * math.pi
    rng = np.random.default_rng(3)
    played, achieved = np.zeros(40000), np.zeros(40000)
    for k in range(played.size):
        t = k * DT
        x = 0.02 * math.sin(omega * t)
        late = 0.7 * played[k - 5] if k >= 5 else 0.0
        achieved[k] = late + 0.05 * late**3
        r = np.array([x, 0.02 * omega * math.cos(omega * t), -(omega**2) * x])
        state, corrected = harmonic_cancellation.step(state, packed, t, r, achieved[k] + 0.05 * rng.normal())
        played[k] = corrected[2]

    def amplitudes(first: int) -> NDArray[np.float64]:
        t = np.arange(first, first + 2000) * DT
        orders = np.arange(1, 12)
        return np.abs(np.exp(-1j * omega * np.outer(orders, t)) @ achieved[first : first + 2000]) / 1000.0

    start, end = amplitudes(500), amplitudes(38000)
    assert np.linalg.norm(start[1:]) / start[0] > 0.05
    assert np.linalg.norm(end[1:]) / end[0] < 0.01
    assert end[0] == pytest.approx(0.02 * omega**2, rel=0.01)


def test_nothing_is_added_to_a_reference_at_rest() -> None:
    path = find("harmonic_cancellation", "default")
    p = harmonic_cancellation.HarmonicCancellation.from_mapping(read_yaml(path), str(path))
    packed, state = numbers(p), harmonic_cancellation.initial_state(p)
    for k in range(5000):
        state, corrected = harmonic_cancellation.step(state, packed, k * DT, np.array([0.01, 0.0, 0.0]), 0.3)
        np.testing.assert_array_equal(corrected, [0.01, 0.0, 0.0])


def test_added_harmonics_are_consistent_in_position_velocity_and_acceleration() -> None:
    path = find("harmonic_cancellation", "default")
    p = harmonic_cancellation.HarmonicCancellation.from_mapping(read_yaml(path), str(path))
    packed, state = numbers(p), harmonic_cancellation.initial_state(p)
    row = harmonic_cancellation.HEAD + 2 * harmonic_cancellation.ROW
    state[row : row + 4] = 0.4, -0.3, 0.4, -0.3
    found = np.array([harmonic_cancellation.step(state, packed, k * DT, np.zeros(3), 0.0)[1] for k in range(900)])
    np.testing.assert_allclose(np.gradient(found[:, 0], DT)[5:-5], found[5:-5, 1], atol=1e-4)
    np.testing.assert_allclose(np.gradient(found[:, 1], DT)[5:-5], found[5:-5, 2], atol=1e-3)
    assert np.max(np.abs(found[:, 2])) == pytest.approx(0.5, rel=1e-3)


def test_a_window_that_is_far_worse_brings_the_best_harmonics_back() -> None:
    path = find("harmonic_cancellation", "default")
    p = harmonic_cancellation.HarmonicCancellation.from_mapping(read_yaml(path), str(path)).replace(harmonics=3)
    state, place = harmonic_cancellation.initial_state(p), harmonic_cancellation.HEAD
    row = harmonic_cancellation.ROW

    def window(added: float, missed: float) -> bool:
        state[place + 2 * row + 2], state[place + 2 * row + 8] = added, missed
        return bool(harmonic_cancellation.judge(state, 1.0, 3))

    assert not window(0.0, 1.0)
    assert not window(0.1, 0.5)
    assert not window(0.2, 0.6)  # a little worse: goes on
    assert state[place + 2 * row + 10] == 0.1
    assert window(0.3, 2.0)
    assert state[harmonic_cancellation.TRUST] == 0.5
    assert state[place + 2 * row + 10] == 0.1
    for _ in range(200):  # what was best is forgotten in the end, and the trust is back
        settled = window(0.3, 2.0)
    assert not settled
    assert state[harmonic_cancellation.TRUST] == pytest.approx(1.0)


def test_an_iteration_that_ended_says_whether_it_diverges_or_has_not_converged() -> None:
    assert iteration.verdict([0.22, 0.05], settings(accepted=0.1)) == ""
    assert "has not converged: the best of 3 runs misses 248.0 %" in iteration.verdict([2.58, 2.60, 2.48], settings())
    assert iteration.verdict([0.2, 0.3, 0.4], settings()).startswith("diverges: run 1 missed 20.0 %")
