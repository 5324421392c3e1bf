"""Resonance searches: forces made by the apparent mass itself, and what became of a resonance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from shake_ros.qualification.resonance import (
    Resonance,
    ResonanceSearch,
    SearchParameters,
    random,
    search,
    search_motion,
    sweep,
)

STEP = 0.002
LOW, HIGH = 1.0, 30.0
MOVING = [(6.0, 0.05, 150.0), (14.0, 0.03, 60.0)]


def forced(acceleration: NDArray[np.float64], moving: list[tuple[float, float, float]]) -> NDArray[np.float64]:
    """Force on 500 kg with oscillators (frequency, damping, mass) [N], of a motion that repeats."""
    w, mass = 2.0 * np.pi * np.fft.rfftfreq(acceleration.size, STEP), np.full(acceleration.size // 2 + 1, 500.0 + 0j)
    for frequency, damping, m in moving:
        own = 2.0 * np.pi * frequency
        mass += m * (own**2 + 2j * damping * own * w) / (own**2 - w**2 + 2j * damping * own * w)
    return np.asarray(np.fft.irfft(mass * np.fft.rfft(acceleration), acceleration.size))


def motion(kind: str) -> NDArray[np.float64]:
    """With four seconds of rest in which the oscillators ring out."""
    wave = sweep(0.8, 36.0, 10.0, STEP) if kind == "sweep" else random(0.8, 36.0, 25.0, STEP, 4)
    return np.pad(wave[: wave.size // 2 * 2], 1000)


@pytest.mark.parametrize("kind", ["sweep", "random"])
@pytest.mark.parametrize("count", [0, 1, 2])
def test_every_resonance_is_found_and_no_other(kind: str, count: int) -> None:
    acceleration = motion(kind)
    noise = 2.0 * np.random.RandomState(3).standard_normal(acceleration.size)
    found = search(forced(acceleration, MOVING[:count]) + noise, acceleration, STEP, LOW, HIGH)
    assert len(found.resonances) == count
    for resonance, (frequency, damping, mass) in zip(found.resonances, MOVING, strict=False):
        assert resonance.frequency == pytest.approx(frequency, rel=0.01)
        assert resonance.damping == pytest.approx(damping, rel=0.2)
        assert resonance.mass == pytest.approx(mass, rel=0.1)


def test_shifts_pair_what_moved_and_name_what_is_gone_or_new() -> None:
    before = ResonanceSearch((Resonance(6.0, 0.04, 150.0), Resonance(14.0, 0.02, 50.0)), 500.0, 1.0)
    after = ResonanceSearch((Resonance(5.4, 0.05, 150.0), Resonance(28.0, 0.02, 50.0)), 500.0, 1.0)
    told = [str(shift) for shift in before.shifts(after)]
    assert told == ["6.00 Hz: frequency -10.0 %, damping +25 %", "14.00 Hz: gone", "new at 28.00 Hz"]
    assert [shift.frequency for shift in before.shifts(after)] == [pytest.approx(-0.1), -1.0, 0.0]


def test_sweep_runs_through_its_band_with_one_amplitude_and_ends_at_rest() -> None:
    asked = SearchParameters(
        motion="sine_sweep", level=0.5, sweep_rate=20.0, duration=20.0, low=LOW, high=HIGH, shift=0.1
    )
    states = search_motion(asked, STEP, seed=0)
    assert np.abs(states[-1]).max() < 1e-9
    inside = states[2000:-2000, 2]
    assert np.max(np.abs(inside)) == pytest.approx(0.5, rel=0.03)
    turns = np.flatnonzero(np.diff(np.sign(inside)) > 0) * STEP
    rate = 1.0 / np.diff(turns)
    slope = np.polyfit(turns[1:], np.log2(rate), 1)[0]
    assert slope == pytest.approx(20.0 / 60.0, rel=0.02)  # octaves a second
