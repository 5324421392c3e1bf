"""Harmonics while a signal is being measured: the newest whole periods, over lost samples, anew after a long gap."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.signals.newest_samples import NewestSamples

MILLISECOND = 1_000_000


def wave(k: int, amplitude: float = 1.0, frequency: float = 5.0) -> float:
    phase = 2.0 * math.pi * frequency * k * 0.001
    return amplitude * (math.sin(phase) + 0.1 * math.sin(3.0 * phase))


def filled(count: int, capacity: int = 1000) -> NewestSamples:
    samples = NewestSamples(capacity, 0.001)
    for k in range(count):
        samples.add(10**9 + k * MILLISECOND, wave(k))
    return samples


def test_nothing_is_said_before_enough_whole_periods_are_there() -> None:
    assert filled(399).harmonics(periods=2, frequency=5.0) is None
    found = filled(400).harmonics(periods=2, frequency=5.0)
    assert found is not None
    assert found.thd == pytest.approx(0.1, rel=1e-6)
    assert found.samples == 400


def test_only_the_newest_periods_count() -> None:
    samples = filled(700)
    for k in range(700, 1300):
        samples.add(10**9 + k * MILLISECOND, wave(k, amplitude=3.0))
    found = samples.harmonics(periods=3, frequency=5.0)
    assert found is not None
    assert found.amplitude[0] == pytest.approx(3.0, rel=1e-9)
    assert found.periods == pytest.approx(3.0)


def test_the_ring_keeps_as_many_samples_as_it_holds_in_their_order() -> None:
    time, values = filled(2345, capacity=500).arrays()
    assert len(time) == 500
    np.testing.assert_allclose(np.diff(time), 0.001, rtol=1e-9)
    assert values[-1] == wave(2344)


@pytest.mark.parametrize(("stamp", "value"), [(1101, 0.0), (500, 0.0), (1000, math.nan), (999, 0.0)])
def test_a_long_gap_a_step_back_a_repeat_and_a_nan_start_anew(stamp: int, value: float) -> None:
    samples = filled(1000)
    samples.add(10**9 + stamp * MILLISECOND, value)
    assert samples.restarts == 1
    assert samples.reason
    assert len(samples) <= 1
    assert samples.harmonics(periods=1, frequency=5.0) is None


def with_losses(single: float, gaps: float, noise: float = 0.0) -> NewestSamples:
    """20 s of which single samples and gaps of 20 … 80 ms are lost by these chances at each sample."""
    random = np.random.default_rng(1)
    samples, away = NewestSamples(10_000, 0.001), 0
    for k in range(20_000):
        away = away - 1 if away else int(random.integers(20, 80)) * (random.random() < gaps)
        if not away and random.random() >= single:
            samples.add(10**9 + k * MILLISECOND, wave(k) + noise * random.standard_normal())
    return samples


@pytest.mark.parametrize(("single", "gaps"), [(0.01, 0.0), (0.1, 0.0), (0.05, 0.001)])
@pytest.mark.parametrize("frequency", [5.0, None])
def test_lost_samples_are_bridged_by_the_true_instants(single: float, gaps: float, frequency: float | None) -> None:
    exact = with_losses(single, gaps).harmonics(5, frequency, 20)
    assert exact is not None
    assert exact.thd == pytest.approx(0.1, rel=1e-6)
    assert exact.periods == pytest.approx(5.0, abs=0.02)
    noisy = with_losses(single, gaps, noise=0.01).harmonics(5, frequency, 20)
    assert noisy is not None
    assert noisy.thd == pytest.approx(0.1, abs=6.0 * noisy.amplitude_error)
    assert noisy.noise == pytest.approx(0.01, rel=0.2)


def test_a_window_that_lost_too_much_is_refused_with_its_share() -> None:
    with pytest.raises(ShakeError, match=r"(39|40|41)% of the window's samples are lost: more than 25%"):
        with_losses(0.4, 0.0).harmonics(5, 5.0, 20)


def test_an_unknown_fundamental_is_found_in_a_full_ring() -> None:
    assert filled(999).harmonics(periods=3) is None
    found = filled(1000).harmonics(periods=3)
    assert found is not None
    assert found.frequency == pytest.approx(5.0, rel=1e-9)


def test_more_periods_than_the_ring_can_hold_are_refused() -> None:
    with pytest.raises(ShakeError, match="need more than 1000 samples"):
        filled(10).harmonics(periods=6, frequency=5.0)


def test_a_ring_without_room_is_refused() -> None:
    with pytest.raises(ShakeError, match="at least 8"):
        NewestSamples(2, 0.001)
