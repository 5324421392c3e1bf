"""Tustin's friction against its closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shake_ros.packing import record
from shake_ros.physics.friction import FRICTIONS, steady_force
from shake_ros.physics.friction.tustin import Tustin, direction

LEVELS = (80.0, 160.0, 2.5, 2.0)
NARROW = 1e-6


def law(*numbers: float) -> Any:
    return record("friction", FRICTIONS, Tustin(*numbers))


def force(velocity: float, *numbers: float) -> float:
    return float(steady_force(law(*numbers), velocity))


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


@pytest.mark.parametrize("width", [1e-4, 1e-3, 2e-2])
def test_a_sharp_passage_through_rest_is_nearly_a_ramp_and_that_of_the_thesis_is_tanh(width: float) -> None:
    speeds = width * np.linspace(-4.0, 4.0, 161)
    plain, sharp = ([direction(law(*LEVELS, width, w), v) for v in speeds] for w in (0.0, 1.0))
    np.testing.assert_allclose(plain, np.tanh(speeds / width), rtol=1e-12, atol=0.0)
    away = np.abs(np.abs(speeds) - width) > 0.3 * width  # from the corner of the ramp
    ramp = np.clip(speeds / width, -1.0, 1.0)
    assert np.max(np.abs(sharp - ramp)[away]) < 0.01 < np.max(np.abs(plain - ramp)[away])
    assert np.max(np.abs(sharp - ramp)) < 0.08
    assert np.all(np.diff(sharp) >= 0.0)


def test_friction_of_a_fast_table_stays_a_number_however_sharp_its_passage() -> None:
    assert force(1.0, *LEVELS, 1e-6, 10.0) == pytest.approx(force(1.0, *LEVELS, 1e-6), rel=1e-12)
