"""Tustin's friction against its closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shake_ros.core.friction.tustin import force

LEVELS = (80.0, 160.0, 2.5, 2.0)
NARROW = 1e-6


def test_force_is_the_closed_form_away_from_rest() -> None:
    # (3.34) by hand: at 0.4 m/s 80 + 160 e^-1 + 0.8
    assert force(0.4, *LEVELS, NARROW) == pytest.approx(80.0 + 160.0 * math.exp(-1.0) + 0.8, rel=1e-12)
    assert force(1e-4, *LEVELS, NARROW) == pytest.approx(240.0, rel=1e-3)


def test_force_is_odd_and_never_drives() -> None:
    for v in np.linspace(-1.0, 1.0, 101):
        assert force(-v, *LEVELS, 1e-3) == -force(v, *LEVELS, 1e-3)
        assert force(v, *LEVELS, 1e-3) * v >= 0.0
    assert force(0.0, *LEVELS, 1e-3) == 0.0


def test_without_levels_only_the_viscous_part_remains() -> None:
    assert force(0.3, 0.0, 0.0, 2.5, 50.0, 1e-3) == pytest.approx(15.0, rel=1e-12)
