"""The target's clock mapped to the host's."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.bridge.table_link import TargetClock

MS = 1_000_000
SECOND = 1_000_000_000


def feed(clock: TargetClock, seconds: int, offset: int, drift: float, start: int = 0) -> np.ndarray:
    """Datagrams every ms with a least way of 30 µs and a tail of delays; returns the errors of the stamps [ns]."""
    ways = 30_000 + np.random.default_rng(7).exponential(120_000, 1000 * seconds)
    errors = []
    for k, way in enumerate(ways):
        target = start + k * MS
        true = target + offset + round(drift * (target - start))
        clock.add(target, true + round(way))
        errors.append(clock.to_host(target) - true)
    return np.array(errors)


@pytest.mark.parametrize("drift", [0.0, 40e-6, -100e-6])
def test_offset_and_drift_are_found_under_random_delays(drift) -> None:
    clock = TargetClock()
    errors = feed(clock, 20, offset=1_700_000_000 * SECOND, drift=drift)
    assert clock.drift == pytest.approx(drift, abs=0.5e-6)
    assert np.abs(errors[5000:] - 30_000).max() < 15_000  # all but the least way
    assert np.abs(np.diff(errors[5000:])).max() < 10_000  # stamps lie on an even grid
    assert clock.jumps == 0


def test_another_clock_is_noticed_and_followed() -> None:
    clock = TargetClock()
    feed(clock, 3, offset=5 * SECOND, drift=0.0)
    errors = feed(clock, 3, offset=9 * SECOND, drift=0.0, start=10 * SECOND)
    assert clock.jumps == 1
    assert clock.last_jump == pytest.approx(4.0, abs=0.01)
    assert abs(errors[-1] - 30_000) < 15_000


def test_one_late_datagram_is_no_other_clock() -> None:
    clock = TargetClock()
    feed(clock, 2, offset=5 * SECOND, drift=0.0)
    clock.add(2 * SECOND, 7 * SECOND + 500 * MS)
    assert clock.jumps == 0
    assert abs(clock.to_host(2 * SECOND) - 7 * SECOND) < 100_000
