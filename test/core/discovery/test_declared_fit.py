"""Starts of the declared fit."""

from __future__ import annotations

import numpy as np

from shake_ros.core.discovery.declared_fit import random_starts
from shake_ros.core.identification.free_parameters import FreeParameters
from shake_ros.declared import free_parameters
from shake_ros.settings import load_table


def test_starts_spread_within_the_bounds_and_are_the_same_every_time() -> None:
    free = FreeParameters(load_table("bergamo"), free_parameters())
    starts = random_starts(free, 20, 4.0)
    assert starts.shape == (20, len(free.names))
    assert np.array_equal(starts[0], free.start())
    assert np.all(starts >= free.low) and np.all(starts <= free.high)
    assert np.array_equal(starts, random_starts(free, 20, 4.0))
    assert not np.array_equal(starts, random_starts(free, 20, 4.0, seed=1))
    assert np.min(np.std(starts, axis=0) / np.mean(starts, axis=0)) > 0.2
