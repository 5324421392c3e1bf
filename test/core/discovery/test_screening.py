"""Screening on linear problems whose answers can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.core.discovery.screening import ScoreTest


def test_a_direction_orthogonal_to_the_parameters_takes_off_its_share_of_the_residual() -> None:
    jacobian = np.array([[1.0], [0.0], [0.0]])
    gain, part = ScoreTest(np.array([0.0, 3.0, 4.0]), jacobian).gain(
        np.array([5.0, -2.0, 0.0]), signed=False, largest=3.0
    )
    assert part == pytest.approx(1.5)
    assert gain == pytest.approx(9.0 / 25.0)


def test_a_direction_that_the_parameters_can_make_as_well_takes_off_nothing() -> None:
    jacobian = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    test = ScoreTest(np.array([1.0, -1.0, 1.0]), jacobian)
    assert test.gain(np.array([2.0, 5.0, 3.0]), signed=True, largest=3.0) == (0.0, 0.0)


def test_a_strength_that_cannot_be_negative_does_not_count_as_such() -> None:
    jacobian = np.array([[1.0], [0.0]])
    test, direction = ScoreTest(np.array([0.0, 1.0]), jacobian), np.array([0.0, 1.0])
    assert test.gain(direction, signed=False, largest=3.0)[0] == 0.0
    assert test.gain(direction, signed=True, largest=3.0) == (pytest.approx(1.0), pytest.approx(-1.0))
